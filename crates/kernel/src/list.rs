//! The pixels that faces may reach, as a list of chunks in the order of a walk.
#![allow(clippy::needless_range_loop)]

use super::{
    face::{Face, Faces},
    float::Float as _,
    lanes::{GROUP, LANES, Lanes, Work, run},
    reach::within,
    real::{Float, Real, splat},
    scene::{BandRef, Scene},
};

/// Faces per list: their prepared data stays in cache.
pub(crate) const LISTED: usize = 64;
/// Unused chunks after the last one, which look-ahead may read.
pub(crate) const AHEAD: usize = 4;
/// Groups after those of a face that are written unconditionally.
const MORE: usize = 2 * LANES + 2 * AHEAD;

/// Some faces of a band and their pixels: groups of neighbours of a row, two groups of one face in a chunk.
pub(crate) struct List<T: Real> {
    blocks: [Faces<T>; LISTED / LANES],
    /// Whether some of them are slivers.
    pub(crate) slivers: bool,
    /// Position of the first pixel of each group relative to the origin of its face: column, and row times 2^24. May be longer than needed.
    places: Vec<u32>,
    /// Position of each group in the band.
    at: Vec<u32>,
    /// Index in the list of the face of each group.
    owners: Vec<u8>,
    chunks: usize,
}

/// Two groups of a list.
#[derive(Clone, Copy)]
pub(crate) struct Chunk<'a> {
    pub(crate) places: &'a [u32; 2],
    pub(crate) at: [u32; 2],
    pub(crate) owner: usize,
}

impl<T: Real> List<T> {
    pub(crate) fn new() -> Self {
        let blocks = [Faces::nothing(); LISTED / LANES];
        let (places, at, owners) = (Vec::new(), Vec::new(), Vec::new());
        Self { blocks, slivers: false, places, at, owners, chunks: 0 }
    }

    /// A face of the list.
    #[inline(always)]
    pub(crate) fn face(&self, owner: usize) -> Face<'_, T> {
        self.blocks[owner / LANES % (LISTED / LANES)].face(owner)
    }

    /// The chunks, grouped by face, followed by `many` unused ones, at most [`AHEAD`].
    #[inline(always)]
    pub(crate) fn chunks(&self, many: usize) -> impl Iterator<Item = Chunk<'_>> {
        let count = self.chunks + many;
        let places = &self.places.as_chunks().0[..count];
        let at = &self.at.as_chunks::<2>().0[..count];
        let owners = &self.owners.as_chunks::<2>().0[..count];
        let groups = places.iter().zip(at.iter().zip(owners));
        groups.map(|(places, (&at, owners))| Chunk { places, at, owner: owners[0] as usize })
    }

    /// Number of chunks.
    pub(crate) fn len(&self) -> usize {
        self.chunks
    }

    /// Makes room for `groups` groups.
    #[cold]
    #[inline(never)]
    fn grow(&mut self, groups: usize) {
        self.places.resize(2 * groups, 0);
        self.at.resize(2 * groups, 0);
        self.owners.resize(2 * groups, 0);
    }

    /// Prepares up to [`LISTED`] faces of a band, given by their numbers, and lists their pixels.
    pub(crate) fn fill(&mut self, scene: &Scene<T>, place: &BandRef<T>, numbers: &[u32]) {
        // One function for all walks: inlining it into each would add a minute to compilation.
        run::<T::Lanes, _>(Fill { list: self, scene, place, numbers });
    }

    #[inline(always)]
    fn filled(&mut self, scene: &Scene<T>, place: &BandRef<T>, numbers: &[u32]) {
        let index = <T::Lanes as Lanes>::index;
        let plus = <T::Lanes as Lanes>::plus;
        let four = splat::<T::Lanes>(GROUP as f64);
        let band = place.rows();
        let stride = scene.stride();
        let nowhere = (band.len() * stride) as u32;
        let (mut rows_apart, mut rows_below) = ([0; LANES], [0; LANES]);
        for lane in 0..LANES {
            rows_apart[lane] = (lane * stride) as i32;
            rows_below[lane] = (lane << 24) as i32;
        }
        let rows_apart = T::Lanes::indices(&rows_apart);
        let rows_below = T::Lanes::indices(&rows_below);
        self.slivers = false;
        let mut listed = 0;
        for (block, numbers) in numbers.chunks(LANES).enumerate() {
            let faces = &mut self.blocks[block % (LISTED / LANES)];
            let spans = place.faces(scene, numbers, faces);
            self.slivers |= faces.any_sliver(numbers.len());
            for (lane, &number) in numbers.iter().enumerate() {
                let owner = (block * LANES + lane) as u8;
                let reach = place.view.reaches[number as usize];
                let rows = within(band.clone(), reach);
                let columns = reach.right - reach.left;
                let most = rows.len() * (columns as usize).div_ceil(GROUP);
                if self.at.len() < listed + most + MORE {
                    self.grow(listed + most + MORE);
                }
                let room = self.at.len();
                let (places, ats) = (&mut self.places[..room], &mut self.at[..room]);
                let owners = &mut self.owners[..room];
                let width = T::Lanes::splat(Float::<T>::of_whole(columns as i32));
                let height = T::Lanes::splat(Float::<T>::of_whole(rows.len() as i32));
                let mut corner = ((rows.start - band.start) * stride) as i32 + reach.left as i32;
                let (mut y, mut row) = (rows_from_origin::<T::Lanes>(), 0);
                while row < rows.len() {
                    let [mut x, end] = spans.columns(lane, y, width);
                    let end = end.only(y.less(height));
                    let start = x.nearest();
                    let mut at = plus(plus(index(corner), rows_apart), start);
                    let mut from_origin = plus(plus(index((row << 24) as i32), rows_below), start);
                    loop {
                        // Most rows have one group or two, which a branch predictor cannot foresee.
                        for _ in 0..2 {
                            *eight(owners, listed) = [owner; LANES];
                            let to = [eight(places, listed), eight(ats, listed)];
                            listed += T::Lanes::pack(x.less(end), [from_origin, at], to);
                            x += four;
                            at = plus(at, index(GROUP as i32));
                            from_origin = plus(from_origin, index(GROUP as i32));
                        }
                        if T::Lanes::bits(x.less(end)) == 0 {
                            break;
                        }
                    }
                    row += LANES;
                    y += splat(LANES as f64);
                    corner += (LANES * stride) as i32;
                }
                // An odd group is paired with an unused one. It is written unconditionally, since the branch would be unpredictable.
                (places[listed], ats[listed]) = (0, nowhere);
                listed += listed % 2;
            }
        }
        if self.at.len() < listed + MORE {
            self.grow(listed + MORE);
        }
        let last = listed..listed + 2 * AHEAD;
        self.places[last.clone()].fill(0);
        self.at[last.clone()].fill(nowhere);
        self.owners[last].fill(numbers.len().saturating_sub(1) as u8);
        self.chunks = listed / 2;
    }
}

/// See [`List::fill`].
struct Fill<'a, 's, T: Real> {
    list: &'a mut List<T>,
    scene: &'a Scene<'s, T>,
    place: &'a BandRef<'a, T>,
    numbers: &'a [u32],
}

impl<T: Real> Work for Fill<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.list.filled(self.scene, self.place, self.numbers);
    }
}

/// A group of pixels.
#[inline(always)]
pub(crate) fn group<F>(numbers: &[F], at: u32) -> &[F; GROUP] {
    numbers[at as usize..at as usize + GROUP].try_into().expect("a group of pixels")
}

/// The numbers of two groups of pixels.
#[inline(always)]
pub(crate) fn of_pixels<T: Real>(numbers: &[Float<T>], [low, high]: [u32; 2]) -> T::Lanes {
    T::Lanes::of_groups(group(numbers, low), group(numbers, high))
}

/// The [`LANES`] numbers at `at`.
#[inline(always)]
fn eight<F>(numbers: &mut [F], at: usize) -> &mut [F; LANES] {
    (&mut numbers[at..at + LANES]).try_into().expect("as many numbers as lanes")
}

/// Row numbers from the first row, one per lane.
#[inline(always)]
pub(crate) fn rows_from_origin<L: Lanes>() -> L {
    let number = L::Float::from_f64;
    let rows = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
    let mut lanes = [L::Float::ZERO; LANES];
    for lane in 0..LANES {
        lanes[lane] = number(rows[lane]);
    }
    L::of(&lanes)
}
