//! What is in the firmware's image: its sections, and the calls between its functions (Arm Architecture Reference Manual for
//! Armv7-M, section A7.7).

use std::collections::{BTreeMap, BTreeSet};

use object::read::elf::ElfFile32;
use object::{
    Object as _, ObjectSection as _, ObjectSymbol as _, SectionFlags, SectionKind, SymbolKind, elf,
};
use rustc_demangle::demangle;

/// An image.
pub struct Image<'a> {
    file: ElfFile32<'a>,
    /// Functions and other named memory by their addresses: size, name, and whether it is a function.
    named: BTreeMap<u32, Named>,
    /// Where data begin and end in the code: at each address, whether data follow.
    data: BTreeMap<u32, bool>,
}

struct Named {
    size: u32,
    name: String,
    is_function: bool,
}

impl<'a> Image<'a> {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// When it is none.
    pub fn read(bytes: &'a [u8]) -> Result<Self, object::Error> {
        let file = ElfFile32::parse(bytes)?;
        let (mut named, mut data) = (BTreeMap::new(), BTreeMap::new());
        // Before it are the addresses of exceptions' handlers; small numbers are no addresses there.
        let code = file.section_by_name(".text").map_or(0, |section| section.address() as u32);
        for symbol in file.symbols() {
            let name = symbol.name()?;
            // The lowest bit of a function's address tells that it is Thumb code.
            let address = symbol.address() as u32 & !1;
            // Mapping symbols (ELF for the Arm Architecture, section 5.5.5).
            if let Some(kind) = name.strip_prefix('$') {
                data.insert(address, kind.starts_with('d'));
            } else if symbol.size() > 0 && address >= code {
                let is_function = symbol.kind() == SymbolKind::Text;
                let name = format!("{:#}", demangle(name));
                named.insert(address, Named { size: symbol.size() as u32, name, is_function });
            }
        }
        Ok(Self { file, named, data })
    }

    /// The sections that are in the flash, and those that are in the memory, with their bytes.
    #[must_use]
    pub fn sections(&self) -> [Vec<(String, u64)>; 2] {
        let (mut flash, mut memory) = (vec![], vec![]);
        for section in self.file.sections().filter(|section| section.size() > 0) {
            let entry = (section.name().unwrap_or_default().to_owned(), section.size());
            let SectionFlags::Elf { sh_flags, .. } = section.flags() else { continue };
            // What is initialized in the memory is kept in the flash.
            let is_loaded = sh_flags.0 & elf::SHF_ALLOC.0 != 0;
            if is_loaded && section.kind() != SectionKind::UninitializedData {
                flash.push(entry.clone());
            }
            if is_loaded && sh_flags.0 & elf::SHF_WRITE.0 != 0 {
                memory.push(entry);
            }
        }
        [flash, memory]
    }

    /// The functions that a function with a name may reach, by calls or through addresses that it has, each with those that
    /// it calls.
    #[must_use]
    pub fn reached_from(&self, name: &str) -> BTreeMap<&str, BTreeSet<&str>> {
        let roots = self.named.iter().filter(|(_, named)| named.is_function && named.name.ends_with(name));
        let mut left: Vec<_> = roots.map(|(&address, _)| address).collect();
        let (mut seen, mut reached) = (BTreeSet::new(), BTreeMap::<_, BTreeSet<_>>::new());
        while let Some(address) = left.pop() {
            let Some(named) = self.named.get(&address).filter(|_| seen.insert(address)) else { continue };
            let Targets { branches, addresses } = if named.is_function {
                self.targets(address, named.size)
            } else {
                Targets { addresses: self.words(address, named.size), ..Targets::default() }
            };
            let branches = branches.into_iter().filter_map(|target| self.containing(target));
            for target in branches.chain(addresses.into_iter().filter_map(|address| self.at(address))) {
                let other = &self.named[&target];
                if named.is_function && other.is_function {
                    reached.entry(&*named.name).or_default().insert(&*other.name);
                }
                left.push(target);
            }
            if named.is_function {
                reached.entry(&named.name).or_default();
            }
        }
        reached
    }

    /// The beginning of what contains an address.
    fn containing(&self, address: u32) -> Option<u32> {
        let (&first, named) = self.named.range(..=address).next_back()?;
        (address < first + named.size).then_some(first)
    }

    /// The beginning of the function or of the data that a word is the address of, if it is one. That of a function is odd.
    fn at(&self, word: u32) -> Option<u32> {
        let first = self.containing(word)?;
        (!self.named[&first].is_function || word == first + 1).then_some(first)
    }

    /// The bytes from an address on.
    fn bytes(&self, address: u32, size: u32) -> &'a [u8] {
        let mut sections = self.file.sections();
        sections
            .find_map(|section| section.data_range(address.into(), size.into()).ok().flatten())
            .unwrap_or_default()
    }

    fn words(&self, address: u32, size: u32) -> BTreeSet<u32> {
        let (words, _) = self.bytes(address, size).as_chunks::<4>();
        words.iter().map(|word| u32::from_le_bytes(*word)).collect()
    }

    fn word(&self, address: u32) -> Option<u32> {
        self.bytes(address, 4).try_into().ok().map(u32::from_le_bytes)
    }

    /// What the instructions of a function branch to, and the words that they load.
    fn targets(&self, first: u32, size: u32) -> Targets {
        let (halves, _) = self.bytes(first, size).as_chunks::<2>();
        let halves: Vec<_> = halves.iter().map(|half| u32::from(u16::from_le_bytes(*half))).collect();
        let Targets { mut branches, mut addresses } = Targets::default();
        let (mut low, mut position) = ([0; 16], 0);
        while position < halves.len() {
            let address = first + 2 * position as u32;
            let half = halves[position];
            if self.data.range(..=address).next_back().is_some_and(|(_, is_data)| *is_data) {
                position += 1;
                continue;
            }
            // What the program counter reads as.
            let counter = address + 4;
            if half >> 11 < 0b11101 {
                // LDR (literal), T1.
                if half >> 11 == 0b01001 {
                    addresses.extend(self.word((counter & !3) + 4 * (half & 0xFF)));
                }
                position += 1;
                continue;
            }
            let Some(&next) = halves.get(position + 1) else { break };
            position += 2;
            let [sign, j1, j2] = [half >> 10 & 1, next >> 13 & 1, next >> 11 & 1];
            let immediate = (half & 0xF) << 12 | (half >> 10 & 1) << 11 | (next >> 12 & 7) << 8 | next & 0xFF;
            let register = (next >> 8 & 0xF) as usize;
            if half >> 11 == 0b11110 && next & 0x9000 == 0x9000 {
                // B, T4, and BL.
                let [i1, i2] = [j1, j2].map(|j| 1 - (j ^ sign));
                let offset = i1 << 23 | i2 << 22 | (half & 0x3FF) << 12 | (next & 0x7FF) << 1;
                branches.insert(counter.wrapping_add(offset).wrapping_sub(sign << 24));
            } else if half >> 11 == 0b11110 && next & 0xD000 == 0x8000 && half >> 7 & 7 != 7 {
                // B, T3.
                let offset = j2 << 19 | j1 << 18 | (half & 0x3F) << 12 | (next & 0x7FF) << 1;
                branches.insert(counter.wrapping_add(offset).wrapping_sub(sign << 20));
            } else if half & 0xFBF0 == 0xF240 && next & 0x8000 == 0 {
                // MOV (immediate), T3.
                low[register] = immediate;
            } else if half & 0xFBF0 == 0xF2C0 && next & 0x8000 == 0 {
                // MOVT.
                addresses.insert(immediate << 16 | low[register]);
            } else if half & 0xFF7F == 0xF85F {
                // LDR (literal), T2.
                let offset = next & 0xFFF;
                let base = counter & !3;
                addresses.extend(self.word(if half >> 7 & 1 == 1 { base + offset } else { base - offset }));
            }
        }
        Targets { branches, addresses }
    }
}

/// Where a function leads.
#[derive(Default)]
struct Targets {
    branches: BTreeSet<u32>,
    addresses: BTreeSet<u32>,
}
