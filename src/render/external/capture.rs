//! What a command says, its beginning and its end: no command can fill memory or disk.

use std::{
    collections::VecDeque,
    io::Read,
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, channel},
    },
    thread,
    time::Duration,
};

/// Bytes, of which the first and the last so many are kept.
#[derive(Clone, Debug)]
pub(crate) struct Capped {
    most: usize,
    head: Vec<u8>,
    tail: VecDeque<u8>,
    left_out: u64,
}

impl Capped {
    /// Keeps `most` bytes at the beginning and as many at the end.
    pub fn new(most: usize) -> Self {
        Capped { most, head: Vec::new(), tail: VecDeque::new(), left_out: 0 }
    }

    /// Adds bytes at the end.
    pub fn push(&mut self, bytes: &[u8]) {
        let (head, rest) = bytes.split_at(bytes.len().min(self.most - self.head.len()));
        self.head.extend_from_slice(head);
        let fits = &rest[rest.len() - rest.len().min(self.most)..];
        let drop = (self.tail.len() + fits.len()).saturating_sub(self.most);
        self.tail.drain(..drop);
        self.left_out += (drop + rest.len() - fits.len()) as u64;
        self.tail.extend(fits);
    }

    /// Whether nothing was said.
    pub fn is_empty(&self) -> bool {
        self.head.is_empty()
    }

    /// As text. What is no UTF-8 is replaced; where bytes are left out, a line says how
    /// many.
    pub fn text(&self) -> String {
        let mut bytes = self.head.clone();
        if self.left_out > 0 {
            bytes.extend_from_slice(format!("\n[... {} bytes are left out ...]\n", self.left_out).as_bytes());
        }
        bytes.extend(&self.tail);
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

/// A stream of a command, read by a thread of its own, so that no pipe ever fills.
pub(super) struct Stream {
    heard: Arc<Mutex<Capped>>,
    ended: Receiver<()>,
}

impl Stream {
    /// Begins to read.
    ///
    /// # Errors
    /// Where no thread can be started.
    pub fn listen(mut from: impl Read + Send + 'static, most: usize) -> std::io::Result<Self> {
        let heard = Arc::new(Mutex::new(Capped::new(most)));
        let (end, ended) = channel();
        let shared = Arc::clone(&heard);
        thread::Builder::new().name("external-output".into()).spawn(move || {
            let mut buffer = [0; 16_384];
            while let Ok(n) = from.read(&mut buffer) {
                if n == 0 {
                    break;
                }
                shared.lock().unwrap_or_else(PoisonError::into_inner).push(&buffer[..n]);
            }
            // Nobody may be waiting any more.
            let _ = end.send(());
        })?;
        Ok(Stream { heard, ended })
    }

    /// What was said. A process that left its group may hold the pipe for ever: it is
    /// not waited for beyond `patience`.
    pub fn heard(self, patience: Duration) -> Capped {
        let _ = self.ended.recv_timeout(patience);
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_beginning_and_the_end_are_kept() {
        let mut all = Capped::new(4);
        assert!(all.is_empty());
        all.push(b"abc");
        all.push(b"defg");
        assert_eq!(all.text(), "abcdefg");
        all.push(b"hij");
        assert_eq!(all.text(), "abcd\n[... 2 bytes are left out ...]\nghij");
        all.push(b"0123456789");
        assert_eq!(all.text(), "abcd\n[... 12 bytes are left out ...]\n6789");
        let mut one = Capped::new(2);
        one.push(&[b'x'; 100]);
        assert_eq!(one.text(), "xx\n[... 96 bytes are left out ...]\nxx");
    }
}
