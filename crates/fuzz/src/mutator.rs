//! Small mutations of files, like damage by editors, networks, disks and attackers.

use crate::random::Random;

/// Longest input, in bytes.
const LONGEST: usize = 1 << 18;

const NUMBERS: [&[u8]; 24] = [
    b"",
    b"0",
    b"-0",
    b"1",
    b"-1",
    b"2",
    b"3",
    b"255",
    b"256",
    b"65535",
    b"65536",
    b"2147483647",
    b"2147483648",
    b"4294967295",
    b"4294967296",
    b"9223372036854775807",
    b"-9223372036854775808",
    b"99999999999999999999",
    b"1e39",
    b"-1e308",
    b"1e-400",
    b"0.5",
    b"nan",
    b"-inf",
];

const WORDS: [u32; 12] =
    [0, 1, 2, 3, 255, 65535, 1 << 20, 1 << 30, i32::MAX as u32, 1 << 31, u32::MAX, u32::MAX - 1];

/// Floats that are rarely tested.
const FLOATS: [f32; 6] = [f32::NAN, f32::INFINITY, f32::MAX, f32::MIN_POSITIVE, -1.0, 255.0];

const BYTES: &[u8] = b"\0\x01\x7f\x80\xff \t\r\n\\/#\"-.0123456789aenvf[]{},:";

/// Creates inputs from valid files.
pub struct Mutator<'a> {
    seeds: &'a [Vec<u8>],
    random: Random,
}

impl<'a> Mutator<'a> {
    /// The mutator of input `number` of the reader `name` in a run with this seed; `seeds` are valid files, at least one.
    pub fn new(seeds: &'a [Vec<u8>], seed: u64, name: &str, number: u64) -> Self {
        Self { seeds, random: Random::new(seed, name, number) }
    }

    /// A valid file with 1 to 13 mutations; at most 2¹⁸ bytes.
    pub fn input(&mut self) -> Vec<u8> {
        let mut bytes = self.random.pick(self.seeds).clone();
        let changes = 1 + self.random.below(4) * self.random.below(5);
        for _ in 0..changes {
            self.change(&mut bytes);
        }
        bytes.truncate(LONGEST);
        bytes
    }

    fn change(&mut self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            bytes.push(self.random.byte());
        }
        let place = self.place(bytes);
        match self.random.below(17) {
            0 => bytes[place] ^= 1 << self.random.below(8),
            1 => bytes[place] = self.random.byte(),
            2 => bytes[place] = *self.random.pick(BYTES),
            3 => bytes.insert(place, *self.random.pick(BYTES)),
            4 => bytes.truncate(place),
            5 => {
                let end = self.end(bytes, place);
                bytes.drain(place..end);
            }
            6 => {
                let end = self.end(bytes, place);
                let copy = bytes[place..end].to_vec();
                let to = self.place(bytes);
                bytes.splice(to..to, copy);
            }
            7 => {
                let other = self.random.pick(self.seeds);
                bytes.truncate(place);
                bytes.extend(&other[self.random.below(other.len() + 1)..]);
            }
            8 | 9 => {
                let number = *self.random.pick(&NUMBERS);
                let at = number_at(bytes, place);
                bytes.splice(at, number.iter().copied());
            }
            10 => {
                let line = line_at(bytes, place);
                let times = 1 + self.random.below(3) * self.random.below(200);
                let copies = bytes[line.clone()].repeat(times);
                bytes.splice(line.start..line.start, copies);
            }
            11 => drop(bytes.drain(line_at(bytes, place))),
            12 => {
                let line = bytes.drain(line_at(bytes, place)).collect::<Vec<_>>();
                if !bytes.is_empty() {
                    let to = line_at(bytes, self.random.below(bytes.len())).start;
                    bytes.splice(to..to, line);
                }
            }
            13 => {
                let number = self.number(bytes.len());
                self.write(bytes, place, number);
            }
            14 => {
                let float = self.random.pick(&FLOATS).to_bits();
                self.write(bytes, place, float);
            }
            15 => {
                let (from, to) = (self.random.byte(), self.random.byte());
                bytes.iter_mut().filter(|byte| **byte == from).for_each(|byte| *byte = to);
            }
            _ => {
                let times = 2 + self.random.below(4);
                bytes.truncate(LONGEST / times);
                *bytes = bytes.repeat(times);
            }
        }
        bytes.truncate(LONGEST);
    }

    /// A position in `bytes`, which must not be empty: half of the time near their start, where most is determined.
    fn place(&mut self, bytes: &[u8]) -> usize {
        let length = if self.random.below(2) == 0 { bytes.len() } else { bytes.len().min(200) };
        self.random.below(length)
    }

    /// The end of a piece of `bytes`: more often short than long.
    fn end(&mut self, bytes: &[u8], place: usize) -> usize {
        let longest = *self.random.pick(&[4, 16, 256, bytes.len()]);
        (place + 1 + self.random.below(longest)).min(bytes.len())
    }

    /// A length, or approximately the total `length`.
    fn number(&mut self, length: usize) -> u32 {
        match self.random.below(3) {
            0 => (length as u32).wrapping_add_signed(self.random.below(65) as i32 - 32),
            _ => *self.random.pick(&WORDS),
        }
    }

    /// Writes one, two or four bytes of `number`, in either order.
    fn write(&mut self, bytes: &mut [u8], place: usize, number: u32) {
        let place = if self.random.below(2) == 0 { place & !3 } else { place };
        let size = *self.random.pick(&[1, 2, 4, 4]);
        let mut word = number.to_le_bytes();
        if self.random.below(4) == 0 {
            word.reverse();
        }
        for (byte, new) in bytes[place..].iter_mut().zip(&word[..size]) {
            *byte = *new;
        }
    }
}

/// The number in a text at `place` or after it; empty at the end if there is none.
fn number_at(bytes: &[u8], place: usize) -> std::ops::Range<usize> {
    let is_number = |byte: &u8| byte.is_ascii_digit() || b"+-.".contains(byte);
    let start = bytes[place..].iter().position(is_number).map_or(bytes.len(), |k| place + k);
    let end = bytes[start..].iter().position(|byte| !is_number(byte));
    start..end.map_or(bytes.len(), |k| start + k)
}

/// The line around `place`, with its end.
fn line_at(bytes: &[u8], place: usize) -> std::ops::Range<usize> {
    let start = bytes[..place].iter().rposition(|&byte| byte == b'\n').map_or(0, |k| k + 1);
    let end = bytes[place..].iter().position(|&byte| byte == b'\n');
    start..end.map_or(bytes.len(), |k| place + k + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_follow_from_seed_name_and_number_alone() {
        let seeds = [b"v 1 2 3\nf 1 2 3\n".to_vec(), vec![]];
        let input = |seed, name, number| Mutator::new(&seeds, seed, name, number).input();
        let all: Vec<_> = (0..2000).map(|number| input(7, "a", number)).collect();
        for (number, bytes) in (0..).zip(&all) {
            assert_eq!(*bytes, input(7, "a", number));
            assert!(bytes.len() <= LONGEST);
        }
        let differ = |other: &dyn Fn(u64) -> Vec<u8>| {
            (0..).zip(&all).filter(|(number, bytes)| **bytes != other(*number)).count()
        };
        assert!(differ(&|number| input(8, "a", number)) > 1900);
        assert!(differ(&|number| input(7, "b", number)) > 1900);
        assert!(differ(&|number| input(7, "a", number + 1)) > 1900);
    }

    #[test]
    fn numbers_and_lines_are_found_around_a_place() {
        let text = b"ab -1.5e3 c\nd 7";
        assert_eq!(&text[number_at(text, 0)], b"-1.5");
        assert_eq!(&text[number_at(text, 10)], b"7");
        assert!(number_at(text, 14).len() == 1 && number_at(b"ab", 1).is_empty());
        assert_eq!(
            (line_at(text, 3), line_at(text, 11), line_at(text, 12)),
            (0..12, 0..12, 12..15)
        );
    }
}
