//! Saved states: what `#[derive(Persistent)]` writes and reads back.
#![cfg(feature = "derive")]

use fmu_export::Persistent;
use fmu_export::persistence::Archive;

#[derive(Clone, Debug, Default, PartialEq, Persistent)]
struct Memory<T> {
    integral: T,
    samples: Vec<u32>,
    #[persistent(skip)]
    sum: u32,
}

#[derive(Default, Persistent)]
struct Pair(f64, #[persistent(skip)] f64);

#[test]
fn derived_structs_persist_all_fields_but_the_skipped() {
    let mut written = Memory { integral: 0.5, samples: vec![3, 4], sum: 7 };
    let mut archive = Archive::writing();
    written.persist(&mut archive).unwrap();
    Pair(2.0, 5.0).persist(&mut archive).unwrap();
    let bytes = archive.into_bytes();
    // The integral, the number of samples and each of them, and the pair's first.
    assert_eq!(bytes.len(), 8 + 8 + 2 * 4 + 8);

    let (mut read, mut pair) = (Memory::default(), Pair::default());
    let mut archive = Archive::reading(&bytes);
    read.persist(&mut archive).unwrap();
    pair.persist(&mut archive).unwrap();
    assert!(archive.is_exhausted());
    assert_eq!(read, Memory { sum: 0, ..written });
    assert_eq!((pair.0.to_bits(), pair.1.to_bits()), (2.0_f64.to_bits(), 0.0_f64.to_bits()));
}

#[derive(Clone, Debug, Default, PartialEq, Persistent)]
enum Mode<T> {
    #[default]
    Sticks,
    Slides(T, #[persistent(skip)] u32),
    Stopped {
        at: Option<f64>,
        since: (u8, usize),
    },
}

fn bytes_of(value: &mut impl Persistent) -> Vec<u8> {
    let mut archive = Archive::writing();
    value.persist(&mut archive).unwrap();
    archive.into_bytes()
}

#[test]
fn derived_enums_persist_their_variant_and_its_fields() {
    let mut modes: [Mode<i8>; 4] = [
        Mode::Sticks,
        Mode::Slides(-1, 7),
        Mode::Stopped { at: Some(0.25), since: (3, 5) },
        Mode::Stopped { at: None, since: (0, usize::MAX) },
    ];
    // The variant, then the fields that are not skipped; for an option, whether there is a value.
    let lengths = [4, 4 + 1, 4 + 1 + 8 + 1 + 8, 4 + 1 + 1 + 8];
    for (written, length) in modes.iter_mut().zip(lengths) {
        let bytes = bytes_of(written);
        assert_eq!(bytes.len(), length, "{written:?}");
        let expected = match written {
            Mode::Slides(direction, _) => Mode::Slides(*direction, 0),
            other => other.clone(),
        };
        // Whatever the previous variant.
        for mut read in [Mode::Sticks, Mode::Slides(4, 0), Mode::Stopped { at: Some(1.0), since: (1, 1) }] {
            let mut archive = Archive::reading(&bytes);
            read.persist(&mut archive).unwrap();
            assert!(archive.is_exhausted());
            assert_eq!(read, expected);
        }
    }
    let error = Mode::<i8>::Sticks.persist(&mut Archive::reading(&[3, 0, 0, 0])).unwrap_err();
    assert_eq!(error.to_string(), "3 in the serialized state is not a variant of Mode");
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(i32)]
enum Gear {
    Low = 1,
    High = 2,
}

fmu_export::enumeration!(Gear { Low = 1, High = 2 });

#[test]
fn enumerations_of_the_declaration_begin_with_their_first_item() {
    assert_eq!(Gear::default(), Gear::Low);
    let mut read = Some(Gear::Low);
    read.persist(&mut Archive::reading(&bytes_of(&mut Some(Gear::High)))).unwrap();
    assert_eq!(read, Some(Gear::High));
}

/// Of a crate that knows serde alone.
#[cfg(feature = "serde")]
#[derive(Clone, Debug, Default, serde::Deserialize, serde::Serialize)]
struct World {
    bodies: Vec<[f64; 2]>,
    name: String,
}

#[cfg(feature = "serde")]
#[derive(Clone, Debug, Default, Persistent)]
struct Simulated {
    #[persistent(serde)]
    world: World,
    steps: u32,
}

#[cfg(feature = "serde")]
#[test]
fn a_foreign_type_is_persisted_by_serde_bit_for_bit() {
    let not_a_number = f64::from_bits(0x7ff8_0000_dead_beef);
    let world = World { bodies: vec![[-0.0, not_a_number], [1e-310, 0.1]], name: "Ä".to_owned() };
    let bytes = bytes_of(&mut Simulated { world: world.clone(), steps: 7 });
    let mut read = Simulated::default();
    let mut archive = Archive::reading(&bytes);
    read.persist(&mut archive).unwrap();
    assert!(archive.is_exhausted());
    let bits = |world: &World| world.bodies.concat().into_iter().map(f64::to_bits).collect::<Vec<_>>();
    assert_eq!((bits(&read.world), read.world.name, read.steps), (bits(&world), world.name, 7));
    for place in 0..bytes.len() {
        assert!(Simulated::default().persist(&mut Archive::reading(&bytes[..place])).is_err(), "{place}");
        let (mut damaged, mut other) = (bytes.clone(), Simulated::default());
        damaged[place] ^= 0xff;
        if other.persist(&mut Archive::reading(&damaged)).is_ok() {
            assert_ne!(bytes_of(&mut other), bytes, "{place}");
        }
    }
}
