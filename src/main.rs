//! The command line of aogauge.

fn main() {}
