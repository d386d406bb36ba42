//! The `proprio` command.
fn main() {}
