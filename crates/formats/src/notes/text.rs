//! Notes on text, lines and columns, and on the files of an archive.

use super::Quoted;
use super::display::{are, either, s};

wavelume_core::declare_notes! {
    /// Remarks for the user (warnings, assumptions) on the lines and columns of text files, and on the files of an
    /// archive.
    TextNote {
        Assumed DecodedAs { encoding: &'static str } => "text decoded as {encoding}";
        Skipped LinesBeforeData { lines: usize } => "{lines} line{s} of text before the data", s = s(lines);
        Skipped LinesAfterEndMark { lines: usize } => "{lines} line{s} after the end mark of the data", s = s(lines);
        Skipped LinesAfterData { lines: usize } => "{lines} line{s} of text after the data", s = s(lines);
        Skipped FiguresAroundData { lines: usize } =>
            "{lines} line{s} of named figures around the data, kept as keywords", s = s(lines);
        Skipped BlankColumns { columns: usize } => "{columns} column{s} that {are} blank throughout",
            s = s(columns), are = are(columns);
        Skipped UnknownColumns { columns: usize, first_names: String } =>
            "{columns} column{s} that {are} not known: {first_names}", s = s(columns), are = are(columns);
        Warning ColumnsWithoutHeader { columns: usize } =>
            "{columns} column{s} of values without a header, named {names}",
            s = s(columns), names = either(columns, "1".to_owned(), format!("1 to {columns}"));
        Skipped OtherFileNamed { key: String } => "`{key}` names another file, which is not opened";
        Assumed OnlyMeasurementOfArchive { member: Quoted } =>
            "{member} was read, as the only measurement of the archive";
    }
}
