//! Hashes what the program is built from: shards that are merged must be of one program, also where
//! each machine builds its own. The compiler and the target do not count, line ends neither.

use sha2::{Digest, Sha256};
use std::{
    env, fs, io,
    path::{Path, PathBuf},
};

/// Sources, and the versions of all libraries. In a package on its own the scenes are a library.
const OF: [&str; 4] = ["src", "scenes/src", "scenes/library", "Cargo.lock"];

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut files = Vec::new();
    for name in OF {
        let path = root.join(name);
        if path.exists() {
            println!("cargo::rerun-if-changed={name}");
            list(&path, &mut files)?;
        }
    }
    files.sort();
    let mut sha = Sha256::new();
    for file in files {
        let name = file.strip_prefix(&root).unwrap_or(&file).components();
        let name: Vec<String> = name.map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
        let mut text = fs::read(&file)?;
        text.retain(|byte| *byte != b'\r');
        sha.update(format!("{}\n{}\n", name.join("/"), text.len()));
        sha.update(text);
    }
    let hash: String = sha.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    println!("cargo::rustc-env=AOGAUGE_BUILD={hash}");
    #[cfg(feature = "embree")]
    {
        println!("cargo::rerun-if-changed=benches/embree.cpp");
        cc::Build::new().cpp(true).file("benches/embree.cpp").opt_level(3).flag("-mavx2").compile("aogauge-embree");
        println!("cargo::rustc-link-lib=embree3");
    }
    Ok(())
}

fn list(path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if !path.is_dir() {
        files.push(path.to_owned());
        return Ok(());
    }
    for entry in fs::read_dir(path)? {
        list(&entry?.path(), files)?;
    }
    Ok(())
}
