//! Measured camera responses as text, in two forms.
//!
//! A table of 256 increasing numbers is the linear light of each code, in any unit. Rows under the header
//! `light,value` sample the response itself: what is stored for some light, both from 0 to 1.

use std::path::Path;

use mba_tracker::photometric::InverseResponse;

use crate::FileError;
use crate::text_lines::{Line, TextFile};

/// Reads either form.
pub(super) fn read(path: &Path) -> Result<InverseResponse, FileError> {
    let file = TextFile::read(path)?;
    let is_header = |line: &Line<'_>| line.fields().eq(["light", "value"]);
    if file.lines().next().is_some_and(|first| is_header(&first)) {
        read_curve(&file, path)
    } else {
        read_codes(&file, path)
    }
}

/// The linear light of each code as text that `read` gets back bit for bit.
pub fn to_text(response: &InverseResponse) -> String {
    let light = |code: u8| format!("{:?}\n", f64::from(response.linear_light(code)));
    (0..=u8::MAX).map(light).collect()
}

/// 256 increasing numbers, separated by white space, commas or line ends; scales the last to 1.
fn read_codes(file: &TextFile, path: &Path) -> Result<InverseResponse, FileError> {
    const EXPECTED: &str = "256 increasing numbers, not negative: the linear light of the codes 0 to 255";
    let mut values: Vec<f32> = Vec::with_capacity(256);
    let mut last_line = 1;
    for line in file.lines() {
        for field in line.fields() {
            let value = line.number(field, EXPECTED)? as f32;
            // Equal lights of two codes could not be told apart again.
            let increases = values.last().is_none_or(|previous| value > *previous);
            if !increases || value < 0.0 || values.len() == 256 {
                return Err(line.malformed(EXPECTED));
            }
            values.push(value);
        }
        last_line = line.number;
    }
    let table = values.as_slice().try_into().ok().and_then(InverseResponse::from_table);
    table.ok_or_else(|| FileError::MalformedLine {
        path: path.to_owned(),
        line: last_line,
        found: format!("{} numbers", values.len()),
        expected: EXPECTED,
    })
}

/// Samples of the response, straight lines in between, turned round.
fn read_curve(file: &TextFile, path: &Path) -> Result<InverseResponse, FileError> {
    const EXPECTED: &str = "rows light,value, both increasing, from 0,0 to 1,1";
    let mut samples: Vec<[f64; 2]> = Vec::new();
    let mut last_line = 1;
    for line in file.lines().skip(1) {
        let [light, value] = line.numbers(EXPECTED)?;
        // A curve that is flat or falls cannot be turned round.
        let continues = match samples.last() {
            None => light == 0.0 && value == 0.0,
            Some(before) => light > before[0] && value > before[1] && light <= 1.0 && value <= 1.0,
        };
        if !continues {
            return Err(line.malformed(EXPECTED));
        }
        samples.push([light, value]);
        last_line = line.number;
    }
    let table = std::array::from_fn(|code| light_of_value(&samples, code as f64 / 255.0) as f32);
    let is_whole = samples.len() > 1 && samples.last() == Some(&[1.0, 1.0]);
    let response = if is_whole { InverseResponse::from_table(&table) } else { None };
    response.ok_or_else(|| FileError::MalformedLine {
        path: path.to_owned(),
        line: last_line,
        found: format!("{} rows", samples.len()),
        expected: EXPECTED,
    })
}

/// The light that is stored as `value`, between samples that begin at 0,0; nothing is lighter than the last.
fn light_of_value(samples: &[[f64; 2]], value: f64) -> f64 {
    let after = samples.partition_point(|sample| sample[1] < value);
    let end = samples.get(after).or(samples.last()).copied().unwrap_or_default();
    match after.checked_sub(1).and_then(|before| samples.get(before)) {
        Some(start) if end[1] > start[1] => {
            start[0] + (end[0] - start[0]) * (value - start[1]) / (end[1] - start[1])
        }
        _ => end[0],
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn read_text(text: &str) -> Result<InverseResponse, FileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("response.csv");
        fs::write(&path, text).unwrap();
        read(&path)
    }

    #[test]
    fn a_sampled_curve_is_turned_round() {
        // The value is the square root of light, so light is the square of the value.
        let rows: String =
            (0..=1000).map(|k| format!("{},{}\n", f64::from(k * k) / 1e6, f64::from(k) / 1e3)).collect();
        let response = read_text(&format!("light,value\n{rows}")).unwrap();
        for code in [0_u8, 1, 17, 128, 254, 255] {
            let expected = (f64::from(code) / 255.0).powi(2);
            let light = f64::from(response.linear_light(code));
            assert!((light - expected).abs() < 3e-7, "code {code}: {light}, expected {expected}");
        }
        let coarse = read_text("light, value\n0 0\n0.25, 0.5\n1,1\n").unwrap();
        // Half way up the second straight: 0.25 + 0.75 * (191/255 - 0.5) / 0.5.
        assert!((f64::from(coarse.linear_light(191)) - 0.623_529_4).abs() < 1e-6);
    }

    #[test]
    fn curves_that_are_no_response_are_refused_with_their_line() {
        for (rows, line, found) in [
            ("0,0\n0.5,0.7\n0.6,0.7\n1,1\n", 4, "0.6,0.7"),
            ("0.1,0\n1,1\n", 2, "0.1,0"),
            ("0,0\n0.5,0.7\n", 3, "2 rows"),
            ("0,0\n2,2\n", 3, "2,2"),
            ("", 1, "0 rows"),
        ] {
            let message = read_text(&format!("light,value\n{rows}")).unwrap_err().to_string();
            let expected = format!("line {line}: expected rows light,value, both increasing");
            assert!(message.contains(&expected) && message.ends_with(&format!("\"{found}\"")), "{message}");
        }
    }

    #[test]
    fn written_tables_come_back_bit_for_bit() {
        let table = std::array::from_fn(|code| (code as f32 / 255.0).powf(2.2) + 1e-4 * code as f32);
        let response = InverseResponse::from_table(&table).unwrap();
        assert_eq!(read_text(&to_text(&response)).unwrap(), response);
    }
}
