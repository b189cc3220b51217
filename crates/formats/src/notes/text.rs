//! Notes on text, lines and columns, and on the files of an archive.

use super::Quoted;

wavelume_core::declare_notes! {
    /// Remarks for the user (warnings, assumptions) on the lines and columns of text files, and on the files of an
    /// archive.
    TextNote {
        Assumed DecodedAs { encoding: &'static str } => "text decoded as {encoding}";
        Skipped LinesBeforeData { lines: usize } => "{lines} lines of text before the data";
        Skipped LinesAfterEndMark { lines: usize } => "{lines} lines after the end mark of the data";
        Skipped LinesAfterData { lines: usize } => "{lines} lines of text after the data";
        Skipped FiguresAroundData { lines: usize } =>
            "{lines} lines of named figures around the data, kept as keywords";
        Skipped BlankColumns { columns: usize } => "{columns} columns that are blank throughout";
        Skipped UnknownColumns { columns: usize, first_names: String } =>
            "{columns} column(s) that are not known: {first_names}";
        Warning ColumnsWithoutHeader { columns: usize } =>
            "{columns} columns of values without a header, named 1 to {columns}";
        Skipped OtherFileNamed { key: String } => "`{key}` names another file, which is not opened";
        Assumed OnlyMeasurementOfArchive { member: Quoted } =>
            "{member} was read, as the only measurement of the archive";
    }
}
