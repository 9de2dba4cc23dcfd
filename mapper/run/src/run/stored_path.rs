//! Paths as a summary stores them.

use std::path::{Path, PathBuf};

/// What a path starts with whose bytes are no text; each of these is then written as `%` and two digits.
const AS_BYTES: &str = "file://";

/// A path as text: as it is, or as an address of the scheme `file` where it is not in UTF-8.
#[must_use]
pub fn stored_path(path: &Path) -> String {
    if let Some(text) = path.to_str() {
        return text.to_owned();
    }
    let of_byte = |byte: &u8| match byte {
        b'!'..=b'~' if *byte != b'%' => char::from(*byte).to_string(),
        other => format!("%{other:02X}"),
    };
    AS_BYTES.to_owned() + &path.as_os_str().as_encoded_bytes().iter().map(of_byte).collect::<String>()
}

/// The path that [`stored_path`] made `text` of.
#[must_use]
pub fn path_of(text: &str) -> PathBuf {
    text.strip_prefix(AS_BYTES).and_then(decoded).unwrap_or_else(|| text.into())
}

/// The path of percent-encoded bytes.
#[cfg(unix)]
fn decoded(text: &str) -> Option<PathBuf> {
    use std::ffi::OsString;
    use std::os::unix::ffi::OsStringExt;

    let mut bytes = text.bytes();
    let mut path = Vec::new();
    while let Some(byte) = bytes.next() {
        path.push(match byte {
            b'%' => {
                let digits = [bytes.next()?, bytes.next()?].map(char::from);
                u8::try_from(digits[0].to_digit(16)? * 16 + digits[1].to_digit(16)?).ok()?
            }
            other => other,
        });
    }
    Some(OsString::from_vec(path).into())
}

/// Paths are text there.
#[cfg(not(unix))]
fn decoded(_: &str) -> Option<PathBuf> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_as_it_is() {
        for path in ["/data/früh", "relative/50%", "", "file:/x"] {
            assert_eq!(stored_path(Path::new(path)), path);
            assert_eq!(path_of(path), Path::new(path));
        }
    }

    #[cfg(unix)]
    #[test]
    fn bytes_come_back() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt;
        let path = Path::new(OsStr::from_bytes(b"/data/fr\xfch 50%"));
        let text = stored_path(path);
        assert_eq!(text, "file:///data/fr%FCh%2050%25");
        assert_eq!(path_of(&text), path);
        // What is no such address is a path.
        assert_eq!(path_of("file:///a%F"), Path::new("file:///a%F"));
        assert_eq!(path_of("file:///a%xy"), Path::new("file:///a%xy"));
    }
}
