//! Failure of a command: one line for stderr and an exit code.

use super::declared::as_typed;
use crate::algebra::AlgebraError;
use crate::compress::{CompressError, DecodeError};
use crate::evaluate::EvaluateError;
use crate::export::ExportError;
use crate::formats::FormatErrorKind;
use crate::pipeline::PipelineError;
use crate::preview::PreviewError;
use std::fmt;
use std::path::Path;

/// Reason why a command failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The command line does not fit the command or the file: exit code 2.
    Usage(String),
    /// The command line names no command: the help, shown on stderr as it is, with exit code 2.
    Help(String),
    /// A failure that is neither wrong usage nor an internal error: exit code 1.
    Failed(String),
    /// The program that reads standard output has closed it: exit code 0 without a message.
    Closed,
    /// Internal error, already reported by the panic hook: exit code 1.
    Bug,
}

impl Failure {
    /// Builds a failure with exit code 1.
    pub fn failed(message: impl fmt::Display) -> Self {
        Self::Failed(message.to_string())
    }

    /// Builds a failure that is caused by a wrong command line, with exit code 2.
    pub fn usage(message: impl fmt::Display) -> Self {
        Self::Usage(message.to_string())
    }

    /// Returns the exit code of the process for this failure.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Help(_) => 2,
            Self::Failed(_) | Self::Bug => 1,
            Self::Closed => 0,
        }
    }

    /// Puts the path of the file that caused the failure before the message.
    #[must_use]
    pub fn about(self, path: &Path) -> Self {
        match self {
            Self::Usage(message) => Self::Usage(format!("{}: {message}", path.display())),
            Self::Failed(message) => Self::Failed(format!("{}: {message}", path.display())),
            Self::Help(_) | Self::Closed | Self::Bug => self,
        }
    }
}

impl fmt::Display for Failure {
    /// Writes the message of a failed command as one line, even if the message quotes text with line breaks. The help
    /// keeps its lines.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(message) | Self::Failed(message) => f.write_str(&one_line(message)),
            Self::Help(text) => f.write_str(text),
            Self::Closed => f.write_str("output closed"),
            Self::Bug => f.write_str("internal error"),
        }
    }
}

/// Returns `text` with every run of white space and control characters replaced by one space.
pub fn one_line(text: &str) -> String {
    let words = text.split(|c: char| c.is_whitespace() || c.is_control()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join(" ")
}

impl From<PipelineError> for Failure {
    fn from(error: PipelineError) -> Self {
        match &error {
            // The file is fine; an option is missing or wrong.
            PipelineError::Format(refusal) | PipelineError::Spectrum(refusal)
                if refusal.kind == FormatErrorKind::NeedsOption =>
            {
                Self::usage(as_typed(&error.to_string()))
            }
            PipelineError::Wavelengths(_)
            | PipelineError::Unbounded(_)
            | PipelineError::Compress(CompressError::Setting(_)) => Self::usage(as_typed(&error.to_string())),
            PipelineError::Format(_)
            | PipelineError::Spectrum(_)
            | PipelineError::Projection(_)
            | PipelineError::Opened(_)
            | PipelineError::Strict(_)
            | PipelineError::Compress(_) => Self::failed(as_typed(&error.to_string())),
        }
    }
}

impl From<DecodeError> for Failure {
    fn from(error: DecodeError) -> Self {
        Self::failed(as_typed(&error.to_string()))
    }
}

impl From<EvaluateError> for Failure {
    fn from(error: EvaluateError) -> Self {
        match error {
            EvaluateError::Decode(_) => Self::failed(as_typed(&error.to_string())),
            EvaluateError::Query(_) | EvaluateError::Axes(_) | EvaluateError::Tensor(_) => {
                Self::usage(as_typed(&error.to_string()))
            }
        }
    }
}

impl From<AlgebraError> for Failure {
    fn from(error: AlgebraError) -> Self {
        match error {
            AlgebraError::Compress(CompressError::Setting(_)) | AlgebraError::Unlike { .. } => {
                Self::usage(as_typed(&error.to_string()))
            }
            _ => Self::failed(as_typed(&error.to_string())),
        }
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Evaluate(error) => error.into(),
            ExportError::Colour(error) => error.into(),
            ExportError::Format(error) if error.kind == FormatErrorKind::OverLimit => {
                Self::usage(as_typed(&error.to_string()))
            }
            ExportError::Unfit(_) | ExportError::Setting(_) | ExportError::OverLimit { .. } => {
                Self::usage(as_typed(&error.to_string()))
            }
            ExportError::Format(_) | ExportError::Strict(_) => Self::failed(as_typed(&error.to_string())),
        }
    }
}

impl From<PreviewError> for Failure {
    fn from(error: PreviewError) -> Self {
        match error {
            PreviewError::Evaluate(error) => error.into(),
            PreviewError::Question(_) => Self::usage(as_typed(&error.to_string())),
            PreviewError::Colour(_) | PreviewError::Encode(_) => Self::failed(as_typed(&error.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compress::{SettingError, UnreachableError};
    use crate::formats::FormatError;

    #[test]
    fn messages_are_one_line() {
        let failure = Failure::failed("line 3:\n\tfound \u{1b}[31m`x`");
        assert_eq!(failure.to_string(), "line 3: found [31m`x`");
        assert_eq!(failure.about(Path::new("a b.ies")).to_string(), "a b.ies: line 3: found [31m`x`");
    }

    #[test]
    fn refusals_that_an_option_mends_are_wrong_usage() {
        let refusal = |kind| FormatError { kind, format: "npy", position: None, message: "no quantity".to_owned() };
        let code = |kind| Failure::from(PipelineError::Format(refusal(kind))).exit_code();
        assert_eq!(code(FormatErrorKind::NeedsOption), 2);
        assert_eq!(code(FormatErrorKind::Malformed), 1);
        assert_eq!(
            Failure::from(PipelineError::Compress(CompressError::Setting(SettingError::NoBasis))).exit_code(),
            2
        );
        assert_eq!(
            Failure::from(PipelineError::Compress(CompressError::Unreachable(UnreachableError::Overflow))).exit_code(),
            1
        );
    }
}
