use std::{fmt, path::PathBuf};

use crate::printable;

/// An error that programs handle specially.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line requests something that does not exist or makes no sense. Exit code 2.
    #[error("{0}")]
    Usage(String),
    /// The folder for the results cannot be written.
    #[error("cannot write to the folder {path:?}: {reason}; choose another with --out")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The error of the system.
        reason: std::io::Error,
    },
    /// A file in the place of a result is not the program's to replace.
    #[error("{} {why}", path.display())]
    Taken {
        /// The file.
        path: PathBuf,
        /// Owner of the file, and the remedy: the end of the sentence.
        why: String,
    },
    /// The user stopped the program. Exit code 130.
    #[error("stopped before it was finished")]
    Interrupted,
}

/// Exit code of an interrupted program: 128 plus the number of SIGINT.
pub const INTERRUPTED: u8 = 130;

/// The end of a program that failed: one line on stderr and an exit code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// 2 for a wrong command line, 130 for an interrupt, 1 for all other failures.
    pub code: u8,
    /// The line after `error: ` or `interrupted: `.
    pub message: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.code == INTERRUPTED { "interrupted" } else { "error" };
        write!(f, "{kind}: {}", printable(&self.message))
    }
}

impl Error {
    /// A mistake on the command line, as an error of any program.
    pub fn usage(message: impl Into<String>) -> anyhow::Error {
        Self::Usage(message.into()).into()
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        let message = one_line(&format!("{error:#}"));
        match error.downcast_ref() {
            Some(Error::Usage(_)) => {
                Failure { code: 2, message: format!("{message} (see --help)") }
            }
            Some(Error::Interrupted) => Failure { code: INTERRUPTED, message },
            _ => Failure { code: 1, message },
        }
    }
}

impl From<clap::Error> for Failure {
    /// Keeps clap's message and tip; its usage and the pointer to `--help` become a bracket.
    fn from(error: clap::Error) -> Self {
        Failure { code: 2, message: format!("{} (see --help)", found(&error)) }
    }
}

/// The message and tip of a clap error, in one line.
pub fn found(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let found = text.split("\n\nUsage:").next().unwrap_or_default();
    let found = found.split("\n\nFor more information").next().unwrap_or_default();
    one_line(found.trim_start_matches("error: "))
}

/// Joins the paragraphs of a message by `; ` and the lines of a paragraph by a space.
fn one_line(text: &str) -> String {
    let paragraphs = text.split("\n\n").map(|paragraph| {
        paragraph
            .lines()
            .map(str::trim)
            .filter(|line| !line.is_empty())
            .collect::<Vec<_>>()
            .join(" ")
    });
    paragraphs.filter(|paragraph| !paragraph.is_empty()).collect::<Vec<_>>().join("; ")
}
