//! Saves an image again, by the encoder of the crate `image`: the same pixels in other
//! bytes, for measuring. `cargo run --release --example resave -- FROM TO`.

use std::{env, error::Error};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = env::args().skip(1);
    let (Some(from), Some(to)) = (args.next(), args.next()) else {
        return Err("two paths are needed: FROM TO".into());
    };
    let mut reader = image::ImageReader::open(from)?;
    reader.no_limits();
    Ok(reader.decode()?.save(to)?)
}
