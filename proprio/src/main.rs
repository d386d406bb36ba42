//! The `proprio` command: all it does is in the rooms of `proprio_host`, so that nothing generic is compiled twice.

fn main() -> std::process::ExitCode {
    proprio_host::command::main()
}
