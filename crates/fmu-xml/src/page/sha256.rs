//! SHA-256 (FIPS 180-4) in Base64, by which a content security policy knows a script.
//!
//! Not a crate's: models' build scripts write pages, and cargo hashes their dependencies into the names of a model's
//! symbols, hence the bytes of its library.

use std::num::Wrapping;

type Word = Wrapping<u32>;

/// The first fractional bits of the square roots of the first 8 primes.
#[rustfmt::skip]
const INITIAL: [u32; 8] = [
    0x6a09_e667, 0xbb67_ae85, 0x3c6e_f372, 0xa54f_f53a, 0x510e_527f, 0x9b05_688c, 0x1f83_d9ab, 0x5be0_cd19,
];

/// The first fractional bits of the cube roots of the first 64 primes.
#[rustfmt::skip]
const ROUNDS: [u32; 64] = [
    0x428a_2f98, 0x7137_4491, 0xb5c0_fbcf, 0xe9b5_dba5, 0x3956_c25b, 0x59f1_11f1, 0x923f_82a4, 0xab1c_5ed5,
    0xd807_aa98, 0x1283_5b01, 0x2431_85be, 0x550c_7dc3, 0x72be_5d74, 0x80de_b1fe, 0x9bdc_06a7, 0xc19b_f174,
    0xe49b_69c1, 0xefbe_4786, 0x0fc1_9dc6, 0x240c_a1cc, 0x2de9_2c6f, 0x4a74_84aa, 0x5cb0_a9dc, 0x76f9_88da,
    0x983e_5152, 0xa831_c66d, 0xb003_27c8, 0xbf59_7fc7, 0xc6e0_0bf3, 0xd5a7_9147, 0x06ca_6351, 0x1429_2967,
    0x27b7_0a85, 0x2e1b_2138, 0x4d2c_6dfc, 0x5338_0d13, 0x650a_7354, 0x766a_0abb, 0x81c2_c92e, 0x9272_2c85,
    0xa2bf_e8a1, 0xa81a_664b, 0xc24b_8b70, 0xc76c_51a3, 0xd192_e819, 0xd699_0624, 0xf40e_3585, 0x106a_a070,
    0x19a4_c116, 0x1e37_6c08, 0x2748_774c, 0x34b0_bcb5, 0x391c_0cb3, 0x4ed8_aa4a, 0x5b9c_ca4f, 0x682e_6ff3,
    0x748f_82ee, 0x78a5_636f, 0x84c8_7814, 0x8cc7_0208, 0x90be_fffa, 0xa450_6ceb, 0xbef9_a3f7, 0xc671_78f2,
];

/// A text's hash in Base64.
pub(super) fn base64(text: &str) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut encoded = String::new();
    for bytes in digest(text.as_bytes()).chunks(3) {
        let bits = (0..3).fold(0, |bits, place| bits << 8 | usize::from(*bytes.get(place).unwrap_or(&0)));
        let digits = [18, 12, 6, 0].map(|shift| char::from(DIGITS[bits >> shift & 63]));
        encoded.extend(&digits[..=bytes.len()]);
        encoded.extend(&['='; 3][bytes.len()..]);
    }
    encoded
}

fn digest(message: &[u8]) -> Vec<u8> {
    let bits = 8 * message.len() as u64;
    let mut padded = [message, &[0x80]].concat();
    let length = (padded.len() + size_of_val(&bits)).next_multiple_of(64);
    padded.resize(length - size_of_val(&bits), 0);
    padded.extend(bits.to_be_bytes());
    let hash = padded.chunks_exact(64).fold(INITIAL.map(Wrapping), compressed);
    hash.iter().flat_map(|word| word.0.to_be_bytes()).collect()
}

/// The hash after another block.
fn compressed(hash: [Word; 8], block: &[u8]) -> [Word; 8] {
    let rotated = |word: Word, by: &[u32]| {
        by.iter().fold(Wrapping(0), |mixed, &by| mixed ^ Wrapping(word.0.rotate_right(by)))
    };
    let mut words = [Wrapping(0); 64];
    for (word, bytes) in words.iter_mut().zip(block.chunks_exact(4)) {
        *word = bytes.iter().fold(Wrapping(0), |word, &byte| word << 8 | Wrapping(byte.into()));
    }
    for t in 16..64 {
        let [early, late] = [words[t - 15], words[t - 2]];
        let early = rotated(early, &[7, 18]) ^ early >> 3;
        let late = rotated(late, &[17, 19]) ^ late >> 10;
        words[t] = words[t - 16] + early + words[t - 7] + late;
    }
    let [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h] = hash;
    for (word, round) in words.into_iter().zip(ROUNDS.map(Wrapping)) {
        let chosen = e & f ^ !e & g;
        let majority = a & b ^ a & c ^ b & c;
        let first = h + rotated(e, &[6, 11, 25]) + chosen + round + word;
        let second = rotated(a, &[2, 13, 22]) + majority;
        [a, b, c, d, e, f, g, h] = [first + second, a, b, c, d + first, e, f, g];
    }
    let mut sums = [a, b, c, d, e, f, g, h];
    sums.iter_mut().zip(hash).for_each(|(sum, word)| *sum += word);
    sums
}

#[cfg(test)]
mod tests {
    use super::base64;

    /// Expected: `openssl dgst -sha256 -binary | base64`, for texts that end within, at and beyond a block's room.
    #[test]
    fn hashes_are_those_of_openssl() {
        let cases = [
            (0, "47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU="),
            (1, "SplVfkAzw1Od4utlRyAXytX5VX96BiWgnxw/biumnEw="),
            (27, "InbgUaYRGWShbZuafQc66aUtLtmuv2VIIKjFmlUvlcw="),
            (28, "oufB+AnReVjiG3zTcKHX0DDgfzr3JYi+Ez1Pc/re5x0="),
            (31, "8pn2gvirJ9Wh4keE+yIGV9HUxS4HmIiVEx28Hq4OLlU="),
            (32, "LlFS5gavsk1YF2CEB1Ft/sRIZsjtY+27U3lTiVvQeqk="),
            (33, "9pbCSuUq8vn21f6u0TDU0Ts88XPr5BiHz7c9IQ93roc="),
            (60, "+Ymq9SJgrvh5CDUKp0ZlJlIWb5AT1C6RSdkktLi+AU8="),
            (500, "i2ceIcNqTXmLHwJ935thGjc84Q/38ZpD7ozQFHIeXZg="),
        ];
        for (length, expected) in cases {
            assert_eq!(base64(&"é".repeat(length)), expected, "{length}");
        }
    }
}
