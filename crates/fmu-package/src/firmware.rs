//! A firmware's image with the A2L that it brings along, whose addresses are those of the image.

use std::collections::BTreeMap;
use std::io;

use fmu_io::reading::broken;
use object::{File, Object as _, ObjectSection as _, ObjectSymbol as _};

/// The section with the A2L without addresses.
const SECTION: &str = ".a2l";
/// What stands before a symbol and the distance from it, in bytes.
const LINK: &str = "SYMBOL_LINK \"";
/// An address that is not known yet.
const UNKNOWN: &str = " 0x0";

/// The A2L of a firmware's image, with the addresses of the image's symbols.
///
/// # Errors
/// When the image is not an object file, has no A2L, or lacks a symbol that the A2L names.
pub fn a2l_of_firmware(image: &[u8]) -> io::Result<String> {
    let file = File::parse(image).map_err(|error| broken(format!("it is not an image: {error}")))?;
    let section = file.section_by_name(SECTION).ok_or_else(|| {
        let reason = "it has no section .a2l: firmware that brings its A2L along has a static of it there, with \
                      `#[used]` and `#[unsafe(link_section = \".a2l\")]`";
        broken(reason)
    })?;
    let text = section.uncompressed_data().map_err(|error| broken(error.to_string()))?;
    let text = str::from_utf8(&text).map_err(|error| broken(format!("its A2L is no text: {error}")))?;
    let symbols: BTreeMap<_, _> = file
        .symbols()
        .filter_map(|symbol| symbol.name().ok().map(|name| (name.to_owned(), symbol.address())))
        .collect();
    with_addresses(text, |symbol| symbols.get(symbol).copied())
}

/// An A2L with addresses, each of which stands before the link that tells where it is.
fn with_addresses(text: &str, address: impl Fn(&str) -> Option<u64>) -> io::Result<String> {
    let mut parts = text.split(LINK);
    let mut before = parts.next().unwrap_or_default();
    let mut addressed = String::new();
    for part in parts {
        let link = part.split_once('"').and_then(|(symbol, rest)| {
            let distance = rest.split_whitespace().next()?.parse::<u64>().ok()?;
            Some((symbol, distance))
        });
        let (symbol, distance) =
            link.ok_or_else(|| broken("its A2L has a SYMBOL_LINK without a distance"))?;
        let address = address(symbol).ok_or_else(|| {
            broken(format!(
                "it has no symbol {symbol}, which its A2L names: the static of that name needs `#[used]` and \
                 `#[unsafe(no_mangle)]`"
            ))
        })?;
        let place = before
            .rfind(UNKNOWN)
            .ok_or_else(|| broken(format!("its A2L has no place for an address of {symbol}")))?;
        addressed += &before[..place];
        addressed += &format!(" 0x{:X}", address + distance);
        addressed += &before[place + UNKNOWN.len()..];
        addressed += LINK;
        before = part;
    }
    Ok(addressed + before)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_item_has_the_address_of_its_own_link() {
        let text = "/begin CHARACTERISTIC gain \"from 0x0 on\" VALUE 0x0 VALUES 0 NONE 0 1\n  SYMBOL_LINK \"PAGE\" 8\n/end\n\
                    /begin MEASUREMENT duty \"\" NONE 0 0 0 1\n  ECU_ADDRESS 0x0\n  SYMBOL_LINK \"MEASURED\" 16\n/end\n";
        let known = |symbol: &str| {
            BTreeMap::from([("PAGE", 0x2000_0000), ("MEASURED", 0x2000_3088)]).get(symbol).copied()
        };
        let expected = text
            .replace("VALUE 0x0", "VALUE 0x20000008")
            .replace("ECU_ADDRESS 0x0", "ECU_ADDRESS 0x20003098");
        assert_eq!(with_addresses(text, known).unwrap(), expected);
        let refusal = with_addresses(text, |symbol| (symbol == "PAGE").then_some(1)).unwrap_err().to_string();
        assert!(refusal.starts_with("it has no symbol MEASURED"), "{refusal}");
    }

    #[test]
    fn other_files_are_refused() {
        let refusal = a2l_of_firmware(b"no image").unwrap_err().to_string();
        assert!(refusal.starts_with("it is not an image"), "{refusal}");
        let this = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        let refusal = a2l_of_firmware(&this).unwrap_err().to_string();
        assert!(refusal.starts_with("it has no section .a2l"), "{refusal}");
    }
}
