//! The format of a serialized state, which detects bytes that are not a state of this FMU (FMI 2.0.5, section 2.1.8).
//!
//! | bytes | content |
//! |---|---|
//! | 8 | [`SIGNATURE`] |
//! | 4 | [`VERSION`] of this format |
//! | 4 + n | the length of the FMU's name, and the name: its model identifier, GUID and type of instance |
//! | 8 | the length of the content |
//! | … | the content: the memory of an instance |
//! | 8 | the checksum of all that precedes |
//!
//! Numbers are little-endian.

use fmu_solve::Error;
use fmu_solve::persistence::{Archive, Persistent};
use fmu_terms::InstanceType;

use crate::allocation::check_memory;
use crate::checksum::checksum;
use crate::model::description::ModelDescription;

const SIGNATURE: [u8; 8] = *b"fmi2stat";
/// Increment with every change of the runtime's content. (The GUID identifies the model's content.)
const VERSION: u32 = 13;
/// The length of the checksum.
const CHECKSUM: usize = 8;

/// The bytes of a value that belongs to an FMU.
///
/// # Errors
/// When the value cannot be written, or memory is short.
pub(crate) fn to_bytes(
    description: &ModelDescription,
    instance_type: InstanceType,
    value: &mut impl Persistent,
) -> Result<Vec<u8>, Error> {
    let mut content = Archive::writing();
    value.persist(&mut content)?;
    let content = content.into_bytes();
    let name = name(description, instance_type);
    let length = SIGNATURE.len() + name.len() + content.len() + 32;
    check_memory(length)?;
    let mut bytes = Vec::with_capacity(length);
    bytes.extend(SIGNATURE);
    bytes.extend(VERSION.to_le_bytes());
    #[allow(clippy::cast_possible_truncation)] // The name of a model is shorter than 4 GB.
    bytes.extend((name.len() as u32).to_le_bytes());
    bytes.extend(name.as_bytes());
    bytes.extend((content.len() as u64).to_le_bytes());
    bytes.extend(content);
    bytes.extend(checksum(&bytes).to_le_bytes());
    Ok(bytes)
}

/// Fills a value from bytes made by [`to_bytes`] for the same FMU.
///
/// # Errors
/// When the bytes are anything else; the value is then undefined.
pub(crate) fn from_bytes(
    description: &ModelDescription,
    instance_type: InstanceType,
    bytes: &[u8],
    value: &mut impl Persistent,
) -> Result<(), Error> {
    let content = content(&name(description, instance_type), bytes)?;
    let mut archive = Archive::reading(content);
    value.persist(&mut archive)?;
    if archive.is_exhausted() {
        Ok(())
    } else {
        Err(Error::new("the serialized state holds more than this FMU's state"))
    }
}

/// The FMU's name in a state.
fn name(description: &ModelDescription, instance_type: InstanceType) -> String {
    format!("{} {} {instance_type}", description.model_identifier, description.guid)
}

/// The content, after checking that the bytes are an intact state of this FMU.
fn content<'b>(expected: &str, bytes: &'b [u8]) -> Result<&'b [u8], Error> {
    let ends_early =
        || Error::new(format!("the {} bytes of the serialized state end too early", bytes.len()));
    let mut rest = bytes;
    let mut take = |count: usize| {
        let (taken, left) = rest.split_at_checked(count)?;
        rest = left;
        Some(taken)
    };
    let signature = take(SIGNATURE.len()).ok_or_else(ends_early)?;
    if signature != SIGNATURE {
        return Err(Error::new("the bytes are not a serialized state of an FMU by this exporter"));
    }
    let version = u32::from_le_bytes(array(take(4)).ok_or_else(ends_early)?);
    if version != VERSION {
        return Err(Error::new(format!(
            "the serialized state has the format {version}; this FMU reads the format {VERSION}"
        )));
    }
    let length = u32::from_le_bytes(array(take(4)).ok_or_else(ends_early)?);
    let found = take(length as usize).ok_or_else(ends_early)?;
    if found != expected.as_bytes() {
        return Err(Error::new(format!(
            "the serialized state is one of {:?}; this FMU is {expected:?}",
            String::from_utf8_lossy(found)
        )));
    }
    let length = u64::from_le_bytes(array(take(8)).ok_or_else(ends_early)?);
    let length = usize::try_from(length).map_err(|_| ends_early())?;
    let content = take(length).ok_or_else(ends_early)?;
    let sum = u64::from_le_bytes(array(take(CHECKSUM)).ok_or_else(ends_early)?);
    if !rest.is_empty() {
        return Err(Error::new(format!("{} bytes follow the end of the serialized state", rest.len())));
    }
    if checksum(&bytes[..bytes.len() - CHECKSUM]) != sum {
        return Err(Error::new("the serialized state is damaged: its checksum differs"));
    }
    Ok(content)
}

fn array<const N: usize>(bytes: Option<&[u8]>) -> Option<[u8; N]> {
    bytes?.try_into().ok()
}
