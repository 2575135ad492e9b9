//! Mutations of the bytes of a file.

use numeric::random::hash64;

/// Numbers that break arithmetic, counts and allocations.
const NUMBERS: [&str; 24] = [
    "1e308",
    "-1e308",
    "NaN",
    "nan",
    "inf",
    "-inf",
    "-0",
    "0",
    "1e-320",
    "0.1e-30",
    "-1",
    "4294967295",
    "4294967296",
    "2147483648",
    "18446744073709551615",
    "9007199254740993",
    "1000000000000",
    "99999999",
    "1e10",
    "-9999",
    "3.5",
    "0x10",
    "1,5",
    "",
];
/// Values of four and eight bytes with the same purpose.
const WORDS: [u64; 12] = [
    0,
    1,
    u64::MAX,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x7ff0_0000_0000_0000,
    0x7ff8_0000_0000_0000,
    0x7fef_ffff_ffff_ffff,
    0x7f80_0000,
    0x0001_0000,
];
/// Pieces of the formats that are read.
const TOKENS: [&str; 40] = [
    "LINE_OFF: ",
    "SAMP_SCALE: ",
    "\n",
    ",",
    ":",
    "{",
    "}",
    "[",
    "]",
    "\"",
    "null",
    "true",
    "[[[[[[",
    "-",
    "e",
    " ",
    "\0",
    "\u{feff}",
    "é",
    "<",
    ">",
    "</",
    "<!DOCTYPE x [<!ENTITY a \"b\">]>",
    "&a;",
    "<gml:pos>",
    "\"type\":\"Solid\"",
    "\"boundaries\":[[[0,0,0]]]",
    "\"vertices\":",
    "element vertex 4294967295\n",
    "property list uint uint x\n",
    "end_header\n",
    "f 1 2 3\n",
    "f -1 -2 -999999\n",
    "v nan nan nan\n",
    "\"transform\":{\"scale\":[0,0,0]}",
    "PINHOLE",
    "OPENCV",
    "\"Point\"",
    "preset = \"town\"\n",
    "size_m = 1e300\n",
];
/// Largest file that a mutation may make, bytes.
const SIZE_MAX: usize = 4 << 20;

/// A source of seeded random numbers.
pub(crate) struct Dice(u64);

impl Dice {
    /// Begins the numbers of one input.
    pub(crate) fn new(seed: u64, number: u64) -> Self {
        Self(hash64(seed ^ hash64(number)))
    }

    fn next(&mut self) -> u64 {
        self.0 = hash64(self.0.wrapping_add(0x9e37_79b9_7f4a_7c15));
        self.0
    }

    /// Returns a number below `count`, which is not 0.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    /// Returns one of some values.
    pub(crate) fn one_of<'a, T>(&mut self, values: &'a [T]) -> &'a T {
        &values[self.below(values.len())]
    }
}

/// Returns the bytes after one to four mutations. `other` is a file of the same kind or another,
/// from which pieces are taken.
pub(crate) fn mutated(bytes: &[u8], other: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..=dice.below(4) {
        mutate(&mut out, other, dice);
        out.truncate(SIZE_MAX);
    }
    out
}

fn mutate(out: &mut Vec<u8>, other: &[u8], dice: &mut Dice) {
    let at = dice.below(out.len() + 1);
    // Headers are at the beginning of files, and are worth more tries than the rest.
    let at = if dice.below(3) == 0 { at.min(dice.below(512)) } else { at };
    let piece = |dice: &mut Dice, bytes: &[u8]| {
        let from = dice.below(bytes.len() + 1);
        let most = 1 << dice.below(12);
        let length = dice.below(most).min(bytes.len() - from);
        from..from + length
    };
    match dice.below(11) {
        0 => out.truncate(at),
        1 | 2 => {
            let bit = 1u8 << dice.below(8);
            out.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= bit);
        }
        3 => {
            let length = *dice.one_of(&[2, 4, 8]);
            let word = dice.one_of(&WORDS).to_le_bytes();
            out.iter_mut().skip(at).zip(&word[..length]).for_each(|(byte, new)| *byte = *new);
        }
        4 => {
            let removed = piece(dice, out);
            out.drain(removed);
        }
        5 => {
            let copied = piece(dice, out);
            let copied = out[copied].repeat(1 + dice.below(40));
            out.splice(at..at, copied);
        }
        6 => {
            let copied = piece(dice, other);
            out.splice(at..at, other[copied].iter().copied());
        }
        7 => {
            let token = dice.one_of(&TOKENS);
            out.splice(at..at, token.bytes());
        }
        _ => replace_number(out, at, dice),
    }
}

/// Puts a hostile number in the place of the first number in the text behind `at`.
fn replace_number(out: &mut Vec<u8>, at: usize, dice: &mut Dice) {
    let Some(from) = (at..out.len()).find(|i| out[*i].is_ascii_digit()) else { return };
    let is_part = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'e' | b'E' | b'-' | b'+');
    let length = out[from..].iter().take_while(|byte| is_part(byte)).count();
    let number = dice.one_of(&NUMBERS);
    out.splice(from..from + length, number.bytes());
}
