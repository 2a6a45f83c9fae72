//! Evaluates all methods on all tasks and writes the tables of the paper with our figures.

fn main() -> std::process::ExitCode {
    compare::main()
}
