use std::{
    fmt,
    fs::File,
    io::{Read, Seek},
    path::Path,
    process::{Command, Output},
    thread,
    time::{Duration, Instant},
};

use serde_json::Value;

/// Far longer than any run of a test on a loaded machine: only a hanging program reaches it.
const LIMIT: Duration = Duration::from_secs(600);

/// A program of the workspace, started as by a user.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    path: &'static str,
    one_thread: bool,
}

/// The exit of a program that failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Exit code.
    pub code: i32,
    /// Everything on stderr.
    pub message: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "exit code {}: {}", self.code, self.message)
    }
}

impl Program {
    /// The program at `env!("CARGO_BIN_EXE_NAME")`.
    pub const fn new(path: &'static str) -> Self {
        Self { path, one_thread: false }
    }

    /// The program with a pool of one thread, as on a machine of one core.
    pub const fn on_one_thread(self) -> Self {
        Self { one_thread: true, ..self }
    }

    /// A command that starts the program.
    pub fn command(self) -> Command {
        let mut command = Command::new(self.path);
        if self.one_thread {
            command.env("RAYON_NUM_THREADS", "1");
        }
        command
    }

    /// Runs a command line whose words have no spaces, with results in `out`; returns its JSON line.
    ///
    /// # Errors
    ///
    /// Exit code and stderr, if the exit code is not 0.
    ///
    /// # Panics
    ///
    /// If the program cannot be started, does not end, is killed by a signal, or prints something else.
    pub fn run_in(self, out: &Path, line: &str) -> Result<Value, Failure> {
        self.run_words(out, &line.split_whitespace().collect::<Vec<_>>())
    }

    /// [`Program::run_in`] for words that may have spaces.
    ///
    /// # Errors
    ///
    /// Exit code and stderr, if the exit code is not 0.
    ///
    /// # Panics
    ///
    /// As for [`Program::run_in`].
    pub fn run_words(self, out: &Path, words: &[&str]) -> Result<Value, Failure> {
        let mut command = self.command();
        command.args(words).args(["--quiet", "--json", "--out"]).arg(out);
        let output = ended(&mut command);
        match output.status.code() {
            Some(0) => Ok(serde_json::from_slice(&output.stdout).unwrap()),
            Some(code) => Err(Failure { code, message: String::from_utf8(output.stderr).unwrap() }),
            None => panic!("{command:?}: {}", output.status),
        }
    }
}

/// The output of a command; it is killed if it does not end.
///
/// # Panics
///
/// If it cannot be started, or does not end within ten minutes.
pub fn ended(command: &mut Command) -> Output {
    let [stdout, stderr] = [(); 2].map(|()| tempfile::tempfile().unwrap());
    let [to_stdout, to_stderr] = [&stdout, &stderr].map(|file| file.try_clone().unwrap());
    let mut child = command.stdout(to_stdout).stderr(to_stderr).spawn().unwrap();
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > LIMIT {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{command:?} did not end: {}", text(&stderr));
        }
        thread::sleep(Duration::from_millis(5));
    };
    Output { status, stdout: read(stdout), stderr: read(stderr) }
}

fn read(mut file: File) -> Vec<u8> {
    let mut bytes = Vec::new();
    file.rewind().unwrap();
    file.read_to_end(&mut bytes).unwrap();
    bytes
}

fn text(file: &File) -> String {
    String::from_utf8_lossy(&read(file.try_clone().unwrap())).into_owned()
}

/// A command that starts `count` processes of a program with MPI.
pub fn mpirun(program: &str, count: usize) -> Command {
    let mut command = Command::new("mpirun");
    let count = count.to_string();
    command.args(["--allow-run-as-root", "--oversubscribe", "-n", &count, program]);
    command
}

/// The warnings of a result, as text.
pub fn warnings(json: &Value) -> String {
    json["warnings"].to_string()
}

/// Asserts that no error of a task's result is NaN or infinite.
///
/// # Panics
///
/// If one is, or is missing.
pub fn assert_finite(json: &Value) {
    for error in ["image_error", "parameter_error"] {
        for key in ["initial", "returned", "final", "best"] {
            assert!(json[error][key].as_f64().is_some_and(f64::is_finite), "{error} {key}: {json}");
        }
    }
}
