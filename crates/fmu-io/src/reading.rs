//! Reading untrusted files, with limits on their sizes.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use sha2::{Digest as _, Sha256};

/// The largest text in bytes; descriptions of the largest models have some 50 MB.
pub const LARGEST_TEXT: u64 = 64 << 20;
/// The largest archive, packed or unpacked, or other binary file in bytes.
pub const LARGEST_CONTENT: u64 = 1 << 30;

/// An error in a file.
#[must_use]
pub fn broken(message: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message.into())
}

/// Opens a file.
///
/// # Errors
/// When it cannot be opened, or is a folder; the message names it.
pub fn open(path: &Path) -> io::Result<File> {
    opened(path)
        .map_err(|error| io::Error::new(error.kind(), format!("cannot open {}: {error}", path.display())))
}

fn opened(path: &Path) -> io::Result<File> {
    let file = File::open(path)?;
    let is_folder = file.metadata()?.is_dir();
    if is_folder { Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder")) } else { Ok(file) }
}

/// Reads a text file.
///
/// # Errors
/// When it cannot be read, is too large or is not UTF-8; the message names the file.
pub fn text(path: &Path) -> io::Result<String> {
    text_as(path, utf_8)
}

/// Reads a text file, whose bytes a function decodes.
///
/// # Errors
/// When it cannot be read, is too large or the function fails; the message names the file.
pub fn text_as<T>(path: &Path, decode: impl FnOnce(Vec<u8>) -> io::Result<T>) -> io::Result<T> {
    let read = opened(path).and_then(|file| up_to(LARGEST_TEXT, file)).and_then(decode);
    read.map_err(|error| cannot_read(path, &error))
}

/// Reads a binary file.
///
/// # Errors
/// When it cannot be read or is too large; the message names the file.
pub fn bytes(path: &Path) -> io::Result<Vec<u8>> {
    let read = opened(path).and_then(|file| up_to(LARGEST_CONTENT, file));
    read.map_err(|error| cannot_read(path, &error))
}

/// The SHA-256 of a binary file, in hexadecimal digits.
///
/// # Errors
/// When it cannot be read or is too large; the message names the file.
pub fn digest(path: &Path) -> io::Result<String> {
    Ok(Sha256::digest(bytes(path)?).iter().fold(String::new(), |text, byte| text + &format!("{byte:02x}")))
}

/// Reads everything.
///
/// # Errors
/// When it fails, or has more than `largest` bytes.
pub fn up_to(largest: u64, reader: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = vec![];
    reader.take(largest + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > largest {
        return Err(broken(format!("it is larger than {largest} bytes")));
    }
    Ok(bytes)
}

/// Bytes as text.
///
/// # Errors
/// When they are not UTF-8; the message names the line.
pub fn utf_8(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = valid.split(|&byte| byte == b'\n').count();
        broken(format!("its line {line} is not UTF-8"))
    })
}

fn cannot_read(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("cannot read {}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_beyond_its_limit_is_refused() {
        assert_eq!(up_to(4, b"text".as_slice()).unwrap(), b"text");
        assert_eq!(up_to(3, b"text".as_slice()).unwrap_err().to_string(), "it is larger than 3 bytes");
        assert!(up_to(1000, io::repeat(0)).is_err());
    }

    #[test]
    fn invalid_utf_8_is_reported_with_its_line() {
        let refusal = utf_8(b"one\ntwo\n\xff".to_vec()).unwrap_err().to_string();
        assert_eq!(refusal, "its line 3 is not UTF-8");
    }

    #[test]
    fn a_missing_file_is_named() {
        let missing = Path::new("there is no such file");
        for refusal in [text(missing).unwrap_err(), bytes(missing).unwrap_err()] {
            assert_eq!(refusal.kind(), io::ErrorKind::NotFound);
            assert!(refusal.to_string().starts_with("cannot read there is no such file: "), "{refusal}");
        }
    }
}
