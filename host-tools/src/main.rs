//! The `proprio` command: all it does is in the library, so that nothing generic is compiled twice.

fn main() -> std::process::ExitCode {
    proprio::command::main()
}
