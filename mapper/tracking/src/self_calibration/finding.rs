//! What was found, in words and numbers.

use std::fmt;

use serde::Serialize;

use mba_io::dataset::Knowledge;

/// A number that was found, with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Value {
    /// The number; of exposure times that differ from frame to frame, the middle one.
    pub value: f64,
    /// Its standard deviation as far as the recording tells.
    pub sigma: f64,
    /// Factor to the unit in which it is printed, and that unit.
    #[serde(skip)]
    pub printed: (f64, &'static str),
}

/// What came of looking for one fact about the camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was looked for: `exposure`, `readout`, `depth_delay`, `depth_shift`, `vignetting`, `depth_scale` or
    /// `focal_length`.
    pub fact: &'static str,
    /// Estimated, or still assumed.
    pub knowledge: Knowledge,
    /// What was found: seconds, pixels for a focal length or a shift, the share of light in the corners for vignetting, raw
    /// units per metre for a depth scale; none if the recording does not tell.
    #[serde(flatten)]
    pub value: Option<Value>,
    /// What else there is to say.
    pub note: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ", self.fact.replace('_', " "))?;
        match &self.value {
            Some(Value { value, sigma, printed: (factor, unit) }) => {
                write!(f, "{:.2} +- {:.2} {unit}", value * factor, sigma * factor)?;
            }
            None => write!(f, "unknown")?,
        }
        if self.note.is_empty() { Ok(()) } else { write!(f, " ({})", self.note) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_read_well() {
        let value = Value { value: 0.016_04, sigma: 0.000_21, printed: (1e3, "ms") };
        let mut finding = Finding {
            fact: "exposure",
            knowledge: Knowledge::Estimated,
            value: Some(value),
            note: "the same for all frames".into(),
        };
        assert_eq!(finding.to_string(), "exposure 16.04 +- 0.21 ms (the same for all frames)");
        let json = serde_json::to_value(&finding).unwrap();
        assert_eq!((json["value"].as_f64(), &json["knowledge"]), (Some(0.016_04), &"estimated".into()));
        (finding.value, finding.note) = (None, String::new());
        assert_eq!(finding.to_string(), "exposure unknown");
    }
}
