//! A race: several ways to trace the same rays, in turn chunk by chunk, each by the
//! thread's own CPU time, so that what else the machine does falls on all alike.

use std::{
    ops::Range,
    sync::{Barrier, Mutex, PoisonError},
};

/// Points that are traced in one go, at most: where there are few, every thread has its share of them.
const CHUNK: usize = 1024;

/// Traces the rays of some points.
type Run<'a> = Box<dyn Fn(Range<usize>, &mut [u8]) + Sync + 'a>;

/// A way to trace the rays of some points.
pub struct Side<'a> {
    /// As in tables.
    pub name: String,
    /// Writes a bit a ray that meets something: a byte eight rays.
    pub run: Run<'a>,
}

/// What a race is over.
#[derive(Clone, Copy, Debug)]
pub struct Course {
    /// Points.
    pub points: usize,
    /// Rays a point, a multiple of eight.
    pub rays: usize,
    /// How often.
    pub rounds: usize,
    /// Threads at once.
    pub threads: usize,
}

/// How a side did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Raced {
    /// CPU seconds of all points: the sum over chunks of medians over rounds.
    pub median: f64,
    /// The same of the least time of each chunk.
    pub least: f64,
    /// Rays that meet something.
    pub hits: u64,
}

/// CPU time of this thread, seconds; by the clock on the wall where the system tells
/// none.
fn cpu_seconds() -> f64 {
    #[cfg(unix)]
    if let Ok(t) = nix::time::clock_gettime(nix::time::ClockId::CLOCK_THREAD_CPUTIME_ID) {
        return t.tv_sec() as f64 + t.tv_nsec() as f64 * 1e-9;
    }
    static START: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    START.elapsed().as_secs_f64()
}

/// Runs all sides. Threads have chunks of their own, and all run the same side at the
/// same time.
pub fn race(course: Course, sides: &[Side<'_>]) -> Vec<Raced> {
    let raced = Mutex::new(vec![Raced::default(); sides.len()]);
    let barrier = Barrier::new(course.threads);
    std::thread::scope(|scope| {
        for thread in 0..course.threads {
            let (raced, barrier) = (&raced, &barrier);
            scope.spawn(move || {
                let own = one_thread(course, sides, thread, barrier);
                let mut all = raced.lock().unwrap_or_else(PoisonError::into_inner);
                for (all, own) in all.iter_mut().zip(own) {
                    all.median += own.median;
                    all.least += own.least;
                    all.hits += own.hits;
                }
            });
        }
    });
    raced.into_inner().unwrap_or_else(PoisonError::into_inner)
}

#[allow(clippy::needless_range_loop)] // a step is a chunk of all sides
fn one_thread(course: Course, sides: &[Side<'_>], thread: usize, barrier: &Barrier) -> Vec<Raced> {
    let Course { points, rays, rounds, threads } = course;
    let bytes = rays / 8;
    let most = points.div_ceil(threads).clamp(1, CHUNK);
    let steps = points.div_ceil(most).div_ceil(threads);
    let mut times = vec![vec![Vec::with_capacity(rounds); steps]; sides.len()];
    let mut raced = vec![Raced::default(); sides.len()];
    let mut out = vec![0u8; most * bytes];
    for round in 0..rounds {
        for step in 0..steps {
            let start = ((step * threads + thread) * most).min(points);
            let chunk = start..(start + most).min(points);
            for turn in 0..sides.len() {
                let side = (turn + step + round) % sides.len();
                let out = &mut out[..chunk.len() * bytes];
                barrier.wait();
                let before = cpu_seconds();
                if !chunk.is_empty() {
                    (sides[side].run)(chunk.clone(), out);
                }
                times[side][step].push(cpu_seconds() - before);
                if round == 0 {
                    raced[side].hits += out.iter().map(|b| u64::from(b.count_ones())).sum::<u64>();
                }
            }
        }
    }
    for (raced, chunks) in raced.iter_mut().zip(&mut times) {
        for times in chunks {
            times.sort_by(f64::total_cmp);
            raced.median += times.get(times.len() / 2).copied().unwrap_or_default();
            raced.least += times.first().copied().unwrap_or_default();
        }
    }
    raced
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn every_side_traces_every_point_once_a_round_and_slower_ones_take_longer() {
        let traced = [AtomicUsize::new(0), AtomicUsize::new(0)];
        let side = |i: usize, work: u32| {
            let traced = &traced;
            let run = move |points: Range<usize>, out: &mut [u8]| {
                traced[i].fetch_add(points.len(), Ordering::Relaxed);
                let spin = (0..work * points.len() as u32).fold(0u32, |x, k| std::hint::black_box(x ^ k));
                out.fill(if spin == u32::MAX { 0 } else { 0b101 });
            };
            Side { name: String::new(), run: Box::new(run) }
        };
        let sides = [side(0, 10), side(1, 400)];
        let raced = race(Course { points: 5000, rays: 16, rounds: 3, threads: 2 }, &sides);
        assert!(traced.iter().all(|n| n.load(Ordering::Relaxed) == 15_000));
        assert!(raced.iter().all(|r| r.hits == 5000 * 4 && 0.0 < r.least && r.least <= r.median));
        assert!(raced[1].least > 5.0 * raced[0].least, "{raced:?}");
    }
}
