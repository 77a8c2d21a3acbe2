//! The rows of a sweep as an Apache Parquet file: the columns of the CSV, numbers as they are.

use std::io;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use super::Table;
use super::table::word;

/// The values of a column; of an optional one those that are there, and for each row whether it has one.
enum Column {
    Numbers(Vec<f64>),
    Known(Vec<f64>, Vec<i16>),
    Counts(Vec<i64>),
    Words(Vec<ByteArray>),
    KnownWords(Vec<ByteArray>, Vec<i16>),
}

impl Column {
    fn known(values: impl Iterator<Item = Option<f64>>) -> Self {
        let values: Vec<Option<f64>> = values.collect();
        let levels = values.iter().map(|value| i16::from(value.is_some()));
        Column::Known(values.iter().flatten().copied().collect(), levels.collect())
    }

    fn field(&self, name: &str) -> Result<TypePtr, ParquetError> {
        let (physical, repetition) = match self {
            Column::Numbers(_) => (Physical::DOUBLE, Repetition::REQUIRED),
            Column::Known(..) => (Physical::DOUBLE, Repetition::OPTIONAL),
            Column::Counts(_) => (Physical::INT64, Repetition::REQUIRED),
            Column::Words(_) => (Physical::BYTE_ARRAY, Repetition::REQUIRED),
            Column::KnownWords(..) => (Physical::BYTE_ARRAY, Repetition::OPTIONAL),
        };
        let text = (physical == Physical::BYTE_ARRAY).then_some(LogicalType::String);
        let field = Type::primitive_type_builder(name, physical);
        let field = field.with_repetition(repetition).with_logical_type(text);
        Ok(Arc::new(field.build()?))
    }

    fn write<W: io::Write + Send>(
        &self,
        group: &mut SerializedRowGroupWriter<'_, W>,
    ) -> Result<(), ParquetError> {
        let Some(mut column) = group.next_column()? else {
            return Ok(());
        };
        match self {
            Column::Numbers(values) => column
                .typed::<DoubleType>()
                .write_batch(values, None, None)?,
            Column::Known(values, levels) => {
                let column = column.typed::<DoubleType>();
                column.write_batch(values, Some(levels), None)?
            }
            Column::Counts(values) => column
                .typed::<Int64Type>()
                .write_batch(values, None, None)?,
            Column::Words(values) => column
                .typed::<ByteArrayType>()
                .write_batch(values, None, None)?,
            Column::KnownWords(values, levels) => {
                let column = column.typed::<ByteArrayType>();
                column.write_batch(values, Some(levels), None)?
            }
        };
        column.close()
    }
}

impl Table<'_> {
    /// One row group with a row per run.
    ///
    /// # Errors
    ///
    /// Where the format does not take so many rows.
    pub fn parquet(&self) -> Result<Vec<u8>, ParquetError> {
        let columns = self.typed_columns();
        let fields = columns.iter().map(|(name, column)| column.field(name));
        let fields = fields.collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder("sweep")
            .with_fields(fields)
            .build()?;
        let properties = Arc::new(WriterProperties::builder().build());
        let mut file = SerializedFileWriter::new(Vec::new(), Arc::new(schema), properties)?;
        let mut group = file.next_row_group()?;
        for (_, column) in &columns {
            column.write(&mut group)?;
        }
        group.close()?;
        file.into_inner()
    }

    /// Names and values, in the order of the CSV.
    fn typed_columns(&self) -> Vec<(String, Column)> {
        let axes = self.names().enumerate().map(|(axis, name)| {
            let values = self.done().map(|(point, _)| point[axis]);
            (name.to_owned(), Column::Numbers(values.collect()))
        });
        let ends = self.at_end().enumerate().map(|(k, name)| {
            let values = self.done().map(|(_, row)| row.end.get(k).copied());
            (name, Column::known(values))
        });
        let rows = || self.done().map(|(_, row)| row);
        let statuses = rows().map(|row| ByteArray::from(word(row)));
        let codes: Vec<Option<&str>> = rows().map(|row| row.code.as_deref()).collect();
        let has_code = codes.iter().map(|code| i16::from(code.is_some())).collect();
        let codes = codes.into_iter().flatten().map(ByteArray::from).collect();
        let objective = self.has_objective().then(|| {
            let values = rows().map(|row| row.objective);
            ("objective".to_owned(), Column::known(values))
        });
        let events = rows().map(|row| row.events as i64).collect();
        let errors = rows().map(|row| row.error_estimate);
        let mut columns: Vec<(String, Column)> = axes.collect();
        columns.push(("status".to_owned(), Column::Words(statuses.collect())));
        columns.push(("code".to_owned(), Column::KnownWords(codes, has_code)));
        columns.extend(ends);
        columns.extend(objective);
        columns.push(("events".to_owned(), Column::Counts(events)));
        columns.push(("error_estimate".to_owned(), Column::known(errors)));
        columns.extend(self.has_expectations.then(|| {
            let values = rows().map(|row| row.missed.map(|missed| missed as f64));
            ("missed".to_owned(), Column::known(values))
        }));
        columns
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    use crate::model::Units;
    use crate::report::Status;
    use crate::study::sweep::{Axis, Grid, Row, Table};

    /// What is written is read again, what is missing too.
    #[test]
    fn a_file_has_the_rows() {
        let axis = Axis::parse("k=[1,2]").expect("an axis");
        let grid = Grid::new(vec![axis], false).expect("a grid");
        let rows = [
            Some(Row {
                status: Some(Status::Solved),
                end: vec![0.25],
                events: 3,
                error_estimate: Some(1e-12),
                ..Row::default()
            }),
            Some(Row::refused(Some("E0501".to_owned()))),
        ];
        let columns = ["x".to_owned()];
        let table = Table {
            grid: &grid,
            columns: &columns,
            rows: &rows,
            has_expectations: false,
            units: &Units::default(),
        };
        let path = std::env::temp_dir().join(format!("nsdc_{}.parquet", std::process::id()));
        let bytes = table.parquet().expect("it is encoded");
        fs::write(&path, bytes).expect("it is written");
        let file = fs::File::open(&path).expect("it is there");
        let reader = SerializedFileReader::new(file).expect("it is read");
        let read: Vec<Vec<(String, Field)>> = (reader.get_row_iter(None).expect("rows"))
            .map(|row| row.expect("a row").into_columns())
            .collect();
        let word = |text: &str| Field::Str(text.to_owned());
        let values = |row: usize| {
            read[row]
                .iter()
                .map(|(_, field)| field.clone())
                .collect::<Vec<_>>()
        };
        let names: Vec<&str> = read[0].iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(
            names,
            [
                "k",
                "status",
                "code",
                "x at end",
                "events",
                "error_estimate"
            ]
        );
        let number = Field::Double;
        assert_eq!(
            values(0),
            [
                number(1.0),
                word("solved"),
                Field::Null,
                number(0.25),
                Field::Long(3),
                number(1e-12)
            ]
        );
        assert_eq!(
            values(1),
            [
                number(2.0),
                word("not_compiled"),
                word("E0501"),
                Field::Null,
                Field::Long(0),
                Field::Null
            ]
        );
        fs::remove_file(path).expect("it is there");
    }
}
