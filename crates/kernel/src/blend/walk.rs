//! Walks over the pixel-face pairs of a band: for the largest weight of a pixel, for sums of weights, and for gradients.
//!
//! Loops run over numbers of corners and channels, as in `lanes`, so that all of them become vectors.
#![allow(clippy::needless_range_loop)]

use super::{
    depth::{DepthAt, cubic, pull_row},
    point::{Point, planes},
    quads::{QUAD, Quads},
    scene::Blend,
    texture::{TEXEL_CHANNELS, TexelSums},
};
use crate::{
    face::Face,
    float::Float as _,
    lanes::{GROUP, Lanes, Places, Work},
    list::{Chunk, LISTED, List, group},
    pair::{Closest, closest},
    real::{Float, Real, everywhere, splat},
    scene::{BandRef, Scene},
    table::TablePosition,
};

/// Numbers of a face that a gradient has beside those of its attributes: x and y of three corners, then their depths.
pub(super) const CORNER_NUMBERS: usize = 9;

/// Stands for the logarithm of a weight of 0.
const HIDDEN: f64 = -1e30;

/// Chunks that are taken through each step together: the chains of one wait for each other, those of several do not.
const BLOCK: usize = 8;

/// A number of a face.
#[derive(Clone, Copy)]
struct Number<T: Real> {
    value: Float<T>,
    tangent: Float<T>,
}

impl<T: Real> Number<T> {
    const ONE: Self = Self { value: Float::<T>::ONE, tangent: Float::<T>::ZERO };

    /// The first lane.
    #[inline(always)]
    fn of(lanes: T) -> Self {
        Self { value: lanes.value().array()[0], tangent: lanes.output().array()[0] }
    }

    /// The number in all lanes.
    #[inline(always)]
    fn lanes(self) -> T {
        T::new(T::Lanes::splat(self.value), T::Lanes::splat(self.tangent))
    }
}

/// What the pairs of a face share beside its edges.
#[derive(Clone, Copy)]
pub(super) struct FaceAttributes<T: Real> {
    /// Barycentric weights on the screen: `constant + x px + y py` each.
    planes: [[Number<T>; 3]; 3],
    /// Whether its area is large enough to divide by.
    some: bool,
    /// The corners as they were given, by their places here.
    order: [usize; 3],
    /// One over the depth of each corner.
    per_depth: [Number<T>; 3],
    /// Logarithm of its largest weight by depth.
    log: Float<T>,
}

/// The faces of a list, and the numbers of the attributes at their corners.
pub(super) struct Shown<T: Real> {
    faces: [FaceAttributes<T>; LISTED],
    /// Face by face.
    attributes: Vec<[Number<T>; 3]>,
    numbers: usize,
}

impl<T: Real> Shown<T> {
    /// The attributes at the corners of a face.
    #[inline(always)]
    fn attributes(&self, owner: usize) -> &[[Number<T>; 3]] {
        &self.attributes[owner * self.numbers..(owner + 1) * self.numbers]
    }
}

/// What some faces are to eight pixels each.
pub(super) struct Block<T: Real> {
    count: usize,
    /// Where pixels lie in the band, seen from the origin of their face, and which face of the list that is.
    at: [[u32; 2]; BLOCK],
    places: [[u32; 2]; BLOCK],
    owner: [usize; BLOCK],
    /// Closest points of the boundaries.
    closest: [Closest<T>; BLOCK],
    /// Depths of the points, and their barycentric weights on the face itself.
    depth: [T; BLOCK],
    weights: [[T; 3]; BLOCK],
    /// Places in the table of the edge softness.
    edge_t: [T; BLOCK],
    edge_row: [Places; BLOCK],
    /// Logarithms of the softnesses.
    log_edge: [T; BLOCK],
    log_depth: [T; BLOCK],
    /// Of visitors that pull: points, how the place in the table moves with the squared distance, the derivative of the logarithm by that
    /// distance, and what depths count.
    point: [Point<T>; BLOCK],
    edge_rate: [T::Lanes; BLOCK],
    edge_slope: [T; BLOCK],
    by_depth: [DepthAt<T>; BLOCK],
}

impl<T: Real> Block<T> {
    #[inline(always)]
    fn nothing() -> Self {
        let zero = T::constant(splat(0.0));
        Self {
            count: 0,
            at: [[0; 2]; BLOCK],
            places: [[0; 2]; BLOCK],
            owner: [0; BLOCK],
            closest: [Closest::nothing(); BLOCK],
            depth: [zero; BLOCK],
            weights: [[zero; 3]; BLOCK],
            edge_t: [zero; BLOCK],
            edge_row: [Places::FIRST; BLOCK],
            log_edge: [zero; BLOCK],
            log_depth: [zero; BLOCK],
            point: [Point::nothing(); BLOCK],
            edge_rate: [splat(0.0); BLOCK],
            edge_slope: [zero; BLOCK],
            by_depth: [DepthAt::nothing(); BLOCK],
        }
    }
}

/// What lies at a point, of what lies at the corners.
#[inline(always)]
fn between<T: Real>([w0, w1, w2]: [T; 3], [c0, c1, c2]: [T; 3]) -> T {
    w0 * c0 + w1 * c1 + w2 * c2
}

/// Where a texture is seen.
#[inline(always)]
fn place_on_texture<T: Real>(weights: [T; 3], attributes: &[[Number<T>; 3]]) -> [T; 2] {
    let [[u0, u1, u2], [v0, v1, v2], ..] = attributes else {
        unreachable!("places have two numbers");
    };
    [
        between(weights, [u0.lanes(), u1.lanes(), u2.lanes()]),
        between(weights, [v0.lanes(), v1.lanes(), v2.lanes()]),
    ]
}

/// What is done to every pair.
pub(super) trait Visitor<T: Real> {
    /// Whether it reads what blocks hold for those that pull.
    const PULLS: bool;

    /// Whether pairs of a face at these places of the band count for nothing.
    #[inline(always)]
    fn skips(&self, face: &FaceAttributes<T>, at: [u32; 2]) -> bool {
        let _ = (face, at);
        false
    }

    /// Takes pairs of a list whose first face is number `first` of the band. Those of a face follow each other.
    fn take(&mut self, blend: &Blend<T>, shown: &Shown<T>, block: &Block<T>, first: usize);

    /// Has taken all pairs of a list whose first face is number `first` of the band.
    #[inline(always)]
    fn ends(&mut self, scene: &Scene<T>, shown: &Shown<T>, first: usize) {
        let _ = (scene, shown, first);
    }
}

/// A walk over the pairs of a band.
pub(super) struct Walk<'a, 's, T: Real, V> {
    pub(super) blend: &'a Blend<'s, T>,
    pub(super) place: BandRef<'a, T>,
    pub(super) view: usize,
    /// Logarithm of the largest weight by depth of each face.
    pub(super) logs: &'a [f32],
    pub(super) visitor: &'a mut V,
}

impl<T: Real, V: Visitor<T>> Work for Walk<'_, '_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        let blend = self.blend;
        let mut list = List::new();
        let mut shown = Shown {
            faces: [FaceAttributes::nothing(); LISTED],
            attributes: vec![[Number::ONE; 3]; LISTED * blend.numbers],
            numbers: blend.numbers,
        };
        let mut block = Block::nothing();
        for (k, numbers) in self.place.view.faces(self.place.band).chunks(LISTED).enumerate() {
            list.fill(&blend.scene, &self.place, numbers);
            let listed = (&list, numbers, k * LISTED);
            if blend.scene.lookup.has_far_cells() || list.slivers {
                self.take::<true, true>(listed, &mut shown, &mut block);
            } else {
                self.take::<false, false>(listed, &mut shown, &mut block);
            }
            self.visitor.ends(&blend.scene, &shown, k * LISTED);
        }
    }
}

impl<T: Real, V: Visitor<T>> Walk<'_, '_, T, V> {
    /// Takes the pairs of a list, given with the numbers of its faces in the scene and that of its first face in the band, block by block.
    #[inline(always)]
    fn take<const FAR: bool, const SLIVERS: bool>(
        &mut self,
        (list, numbers, first): (&List<T>, &[u32], usize),
        shown: &mut Shown<T>,
        block: &mut Block<T>,
    ) {
        let blend = self.blend;
        let mut met = None;
        for (k, Chunk { places, at, owner }) in list.chunks(0).enumerate() {
            if met != Some(owner) {
                shown.set(blend, &self.place, self.view, list.face(owner), owner, numbers[owner]);
                shown.faces[owner % LISTED].log =
                    Float::<T>::from_f64(f64::from(self.logs[numbers[owner] as usize]));
                met = Some(owner);
            }
            if !self.visitor.skips(&shown.faces[owner % LISTED], at) {
                let slot = block.count % BLOCK;
                (block.at[slot], block.places[slot], block.owner[slot]) = (at, *places, owner);
                block.count = slot + 1;
            }
            if block.count == BLOCK || k + 1 == list.len() {
                self.measure::<FAR, SLIVERS>(block, list);
                self.locate(block, list, shown);
                self.weigh(block);
                self.visitor.take(blend, shown, block, first);
                block.count = 0;
            }
        }
    }

    /// Closest points of the boundaries, and places in the table of the edge softness.
    #[inline(always)]
    fn measure<const FAR: bool, const SLIVERS: bool>(&self, block: &mut Block<T>, list: &List<T>) {
        let lookup = self.blend.scene.lookup;
        let pick = <T::Lanes as Lanes>::pick;
        let zero = splat::<T::Lanes>(0.0);
        for k in 0..block.count.min(BLOCK) {
            let (px, py) = T::Lanes::pixels(&block.places[k]);
            let closest = closest::<T, SLIVERS>(list.face(block.owner[k]), px, py);
            // The table is that of the mirrored softness, so that its inner side is outside the face.
            let outside = zero.less(pick(closest.inside, zero, splat(1.0)));
            let TablePosition { row, t, rate } = lookup.place::<T, FAR>(closest.distance2, outside);
            (block.edge_row[k], block.edge_t[k]) = (row, t);
            if V::PULLS {
                (block.edge_rate[k], block.closest[k]) = (rate, closest);
            } else {
                block.closest[k].inside = closest.inside;
                block.closest[k].weights = closest.weights;
            }
        }
    }

    /// Points of the faces, and their depths.
    #[inline(always)]
    fn locate(&self, block: &mut Block<T>, list: &List<T>, shown: &Shown<T>) {
        for slot in 0..block.count.min(BLOCK) {
            let owner = block.owner[slot];
            let face = &shown.faces[owner % LISTED];
            let (px, py) = T::Lanes::pixels(&block.places[slot]);
            let [constant, x, y] = &face.planes;
            let mut own = [T::constant(splat(0.0)); 3];
            for k in 0..3 {
                own[k] = constant[k].lanes() + x[k].lanes().scale(px) + y[k].lanes().scale(py);
            }
            let point = Point::new(&block.closest[slot], list.face(owner), own, face.some);
            // 1 / z is what interpolates linearly on the screen.
            let [r0, r1, r2] = face.per_depth;
            let [l0, l1, l2] = point.barycentric;
            let parts = [l0 * r0.lanes(), l1 * r1.lanes(), l2 * r2.lanes()];
            let depth = T::inverse(parts[0] + parts[1] + parts[2]);
            block.depth[slot] = depth;
            block.weights[slot] = [parts[0] * depth, parts[1] * depth, parts[2] * depth];
            if V::PULLS {
                block.point[slot] = point;
            }
        }
    }

    /// Logarithms of softnesses.
    #[inline(always)]
    fn weigh(&self, block: &mut Block<T>) {
        let blend = self.blend;
        let zero = T::constant(splat(0.0));
        let table = self.place.table;
        let (near, per_range) = (T::Lanes::splat(blend.near), T::Lanes::splat(blend.per_range));
        for k in 0..block.count.min(BLOCK) {
            let [value, slope] = cubic(T::rows(table, &block.edge_row[k]), block.edge_t[k]);
            block.log_edge[k] = zero - value;
            let by_depth = blend.depth.at((T::constant(near) - block.depth[k]).scale(per_range));
            block.log_depth[k] = by_depth.log();
            if V::PULLS {
                block.edge_slope[k] = slope.scale(block.edge_rate[k].neg());
                block.by_depth[k] = by_depth;
            }
        }
    }
}

impl<T: Real> FaceAttributes<T> {
    /// Of no face.
    fn nothing() -> Self {
        let one = Number::ONE;
        Self {
            planes: [[one; 3]; 3],
            some: false,
            order: [0, 1, 2],
            per_depth: [one; 3],
            log: Float::<T>::ZERO,
        }
    }
}

impl<T: Real> Shown<T> {
    /// Takes face `owner` of the list, number `number` of the scene.
    #[inline(always)]
    fn set(
        &mut self,
        blend: &Blend<T>,
        place: &BandRef<T>,
        view: usize,
        face: Face<T>,
        owner: usize,
        number: u32,
    ) {
        let own = &mut self.faces[owner % LISTED];
        own.order = face.corners();
        let (corners, entries) =
            (blend.scene.faces[number as usize], blend.entries[number as usize]);
        let depths = 2 * (place.vertices.len() / 3);
        let first = blend.first_attribute(view);
        let attributes = &mut self.attributes[owner * self.numbers..(owner + 1) * self.numbers];
        for k in 0..3 {
            let at = depths + corners[own.order[k]] as usize;
            own.per_depth[k] =
                Number::of(T::inverse(everywhere(place.vertices, place.tangents, at)));
            let start = first + entries[own.order[k]] as usize * blend.numbers;
            for (c, attribute) in attributes.iter_mut().enumerate() {
                let [values, tangents] = blend.attributes;
                let tangent = if T::DUAL { tangents[start + c] } else { Float::<T>::ZERO };
                attribute[k] = Number { value: values[start + c], tangent };
            }
        }
        let (planes, some) = planes(face, blend.least_area);
        own.some = some;
        for j in 0..3 {
            for k in 0..3 {
                own.planes[j][k] = Number::of(planes[j][k]);
            }
        }
    }
}

impl<T: Real> Blend<'_, T> {
    /// Weights of pairs relative to those of the logarithm `largest`: all of it, and the part that the edge softness makes before its
    /// floor is taken off.
    #[inline(always)]
    fn weight(&self, log_edge: T, log_depth: T, largest: T::Lanes) -> [T; 2] {
        let by_depth = log_depth - T::constant(largest);
        let whole = (log_edge + by_depth).power_of_e();
        if self.floor == Float::<T>::ZERO {
            return [whole, whole];
        }
        let rest = T::Lanes::splat(Float::<T>::ONE / (Float::<T>::ONE - self.floor));
        // A face that does not count may be nearer than all that do: then this is anything, and masked.
        let floor = by_depth.power_of_e().scale(T::Lanes::splat(self.floor));
        let some = T::Lanes::splat(self.counts_from).less(log_edge.value());
        [(whole - floor).scale(rest).masked(some), whole.scale(rest).masked(some)]
    }
}

/// The numbers of two groups of pixels.
#[inline(always)]
fn of_pixels<L: Lanes>(numbers: &[L::Float], [low, high]: [u32; 2]) -> L {
    L::of_groups(group(numbers, low), group(numbers, high))
}

/// Finds the logarithm of the largest weight of each pixel.
pub(super) struct Largest<'a, T: Real> {
    pub(super) largest: &'a mut [Float<T>],
}

impl<T: Real> Visitor<T> for Largest<'_, T> {
    const PULLS: bool = false;

    #[inline(always)]
    fn take(&mut self, blend: &Blend<T>, _: &Shown<T>, block: &Block<T>, _: usize) {
        for k in 0..block.count.min(BLOCK) {
            let log_edge = block.log_edge[k].value();
            let log = log_edge + block.log_depth[k].value();
            // A face that does not count must make nothing else vanish.
            let some = T::Lanes::splat(blend.counts_from).less(log_edge);
            let logs = <T::Lanes as Lanes>::pick(some, log, splat(HIDDEN)).array();
            for (half, at) in block.at[k].into_iter().enumerate() {
                for i in 0..GROUP {
                    let (place, log) = (&mut self.largest[at as usize + i], logs[half * GROUP + i]);
                    *place = if log > *place { log } else { *place };
                }
            }
        }
    }
}

/// Adds up weights, and weights times attributes.
pub(super) struct Sums<'a, T: Real> {
    pub(super) largest: &'a [Float<T>],
    /// The weights, then what each channel adds up to.
    pub(super) sums: &'a mut Quads<Float<T>>,
}

impl<T: Real> Sums<'_, T> {
    /// Adds what channel after channel shows, weighted, and before them the weight.
    #[inline(always)]
    fn add(&mut self, at: [u32; 2], weight: T, weights: [T; 3], attributes: &[[Number<T>; 3]]) {
        let first = shown(attributes, 0, weights);
        let (second, third) = (shown(attributes, 1, weights), shown(attributes, 2, weights));
        self.sums.add(0, at, [weight, weight * first, weight * second, weight * third]);
        for quad in 1..self.sums.count() {
            let mut numbers = [weight; QUAD];
            for k in 0..QUAD {
                numbers[k] = weight * shown(attributes, QUAD * quad + k - 1, weights);
            }
            self.sums.add(quad, at, numbers);
        }
    }
}

/// Number `number` of the attributes at a point, 0 beyond the last.
#[inline(always)]
fn shown<T: Real>(attributes: &[[Number<T>; 3]], number: usize, weights: [T; 3]) -> T {
    match attributes.get(number) {
        Some([a, b, c]) => between(weights, [a.lanes(), b.lanes(), c.lanes()]),
        None => T::constant(splat(0.0)),
    }
}

impl<T: Real> Visitor<T> for Sums<'_, T> {
    const PULLS: bool = false;

    #[inline(always)]
    fn take(&mut self, blend: &Blend<T>, shown: &Shown<T>, block: &Block<T>, _: usize) {
        let count = block.count.min(BLOCK);
        let zero = T::constant(splat(0.0));
        let mut weights = [zero; BLOCK];
        for k in 0..count {
            let largest = of_pixels::<T::Lanes>(self.largest, block.at[k]);
            let [weight, _] = blend.weight(block.log_edge[k], block.log_depth[k], largest);
            // Numbers so small that they lose digits take a hundred times as long to multiply.
            weights[k] = weight.masked(T::Lanes::splat(blend.vanishing).less(weight.value()));
        }
        for k in 0..count {
            let (at, weight) = (block.at[k], weights[k]);
            let attributes = shown.attributes(block.owner[k]);
            let Some(texture) = &blend.texture else {
                self.add(at, weight, block.weights[k], attributes);
                continue;
            };
            let mut seen =
                texture.sample(place_on_texture(block.weights[k], attributes)).channels();
            // A texture has as many numbers as a quad, of which the image may have fewer.
            for channel in blend.channels..TEXEL_CHANNELS {
                seen[channel % TEXEL_CHANNELS] = zero;
            }
            let [a, b, c, d] = seen;
            self.sums.add(0, at, [weight, weight * a, weight * b, weight * c]);
            if self.sums.count() > 1 {
                self.sums.add(1, at, [weight * d, zero, zero, zero]);
            }
        }
    }
}

/// Gradients of `Σ upstream · image` to a band's faces and to the tables.
pub(super) struct Pull<'a, T: Real> {
    /// Of each pixel 0: the logarithm that weights are relative to; 1: one over the sum of all weights; 2: `Σ upstream · image` over the channels,
    /// less the upstream of the faces' share; 3: the logarithm of a weight that may be left out of the sum.
    pub(super) pixels: &'a Quads<Float<T>>,
    /// Number 3 of the pixels side by side: each chunk reads it, to be skipped.
    pub(super) limits: &'a [Float<T>],
    /// The upstream by channels, without tangents.
    pub(super) upstream: &'a Quads<Float<T>>,
    /// For each face of the band [`CORNER_NUMBERS`] numbers, then three for each number of an attribute if the gradient to the attributes is wanted.
    pub(super) faces: &'a mut [Float<T>],
    pub(super) stride: usize,
    /// Gradients to the tables of edge and depth, if they are wanted.
    pub(super) tables: Option<&'a mut [Vec<[Float<T>; 4]>; 2]>,
    pub(super) corners: [T::Lanes; CORNER_NUMBERS],
    pub(super) attributes: Vec<[T::Lanes; 3]>,
    /// Gradient to the texels, if it is wanted.
    pub(super) texels: Option<&'a mut TexelSums<Float<T>>>,
    /// The face of the list whose pairs are being added up.
    pub(super) owner: Option<usize>,
}

impl<T: Real> Pull<'_, T> {
    /// Adds to the gradient of a number of the attributes, of a function with this derivative by it at the point of a pair.
    #[inline(always)]
    fn pull_attribute(&mut self, number: usize, by_number: T, weights: [T; 3]) {
        if let Some(sums) = self.attributes.get_mut(number) {
            for k in 0..3 {
                sums[k] += (by_number * weights[k]).output();
            }
        }
    }

    /// Adds what the pairs of a face have added up to.
    #[inline(always)]
    fn flush(&mut self, scene: &Scene<T>, shown: &Shown<T>, first: usize) {
        let Some(owner) = self.owner else { return };
        // From pixels, with y down, to NDC.
        let [right, down] = [scene.half, -scene.half].map(Float::<T>::from_f64);
        let own = &mut self.faces[(first + owner) * self.stride..(first + owner + 1) * self.stride];
        for k in 0..3 {
            let corner = shown.faces[owner % LISTED].order[k];
            own[2 * corner] += self.corners[2 * k].sum() * right;
            own[2 * corner + 1] += self.corners[2 * k + 1].sum() * down;
            own[6 + corner] += self.corners[6 + k].sum();
            for (number, sums) in self.attributes.iter_mut().enumerate() {
                own[CORNER_NUMBERS + 3 * number + corner] += sums[k].sum();
                sums[k] = splat(0.0);
            }
        }
        self.corners = [splat(0.0); CORNER_NUMBERS];
    }
}

/// Whether a mask holds nowhere.
#[inline(always)]
fn nowhere<L: Lanes>(mask: L::Mask) -> bool {
    L::bits(mask) == 0
}

impl<T: Real> Visitor<T> for Pull<'_, T> {
    const PULLS: bool = true;

    #[inline(always)]
    fn skips(&self, face: &FaceAttributes<T>, at: [u32; 2]) -> bool {
        // Now that the sums are known, what is hidden by nearer faces is known too.
        let log = T::Lanes::splat(face.log);
        nowhere::<T::Lanes>(of_pixels::<T::Lanes>(self.limits, at).less(log))
    }

    #[inline(always)]
    fn take(&mut self, blend: &Blend<T>, shown: &Shown<T>, block: &Block<T>, first: usize) {
        let zero = T::constant(splat(0.0));
        let count = block.count.min(BLOCK);
        // Those that count somewhere.
        let (mut live, mut some) = ([0; BLOCK], 0);
        for k in 0..count {
            let log = block.log_edge[k].value() + block.log_depth[k].value();
            live[some % BLOCK] = k;
            let limit = of_pixels::<T::Lanes>(self.limits, block.at[k]);
            some += usize::from(!nowhere::<T::Lanes>(limit.less(log)));
        }
        let live = &live[..some.min(BLOCK)];
        // Shares of the image: all of a weight, and the part that the edge softness makes before its floor is taken off.
        let (mut shares, mut images) = ([[zero; 2]; BLOCK], [zero; BLOCK]);
        for &k in live {
            let k = k % BLOCK;
            let log = block.log_edge[k].value() + block.log_depth[k].value();
            let [largest, per_total, image, limit] = self.pixels.groups::<T>(0, block.at[k]);
            let counts = limit.value().less(log);
            let weights = blend.weight(block.log_edge[k], block.log_depth[k], largest.value());
            shares[k] =
                [weights[0].masked(counts) * per_total, weights[1].masked(counts) * per_total];
            images[k] = image;
        }
        for &k in live {
            let k = k % BLOCK;
            let (at, weights, depth) = (block.at[k], block.weights[k], block.depth[k]);
            let [share, of_edge] = shares[k];
            let owner = block.owner[k];
            if self.owner != Some(owner) {
                self.flush(&blend.scene, shown, first);
                self.owner = Some(owner);
            }
            let face = &shown.faces[owner % LISTED];
            let attributes = shown.attributes(owner);
            // How the objective changes with the attributes of the three corners, were the point there, and what it is at the point.
            let mut at_corners = [zero; 3];
            let (here, there);
            if let Some(texture) = &blend.texture {
                let sample = texture.sample(place_on_texture(weights, attributes));
                let [a, b, c, d] = self.upstream.groups::<T>(0, at);
                let mut upstream = [a.value(), b.value(), c.value(), d.value()];
                for channel in blend.channels..TEXEL_CHANNELS {
                    upstream[channel % TEXEL_CHANNELS] = splat(0.0);
                }
                let [seen, by_u, by_v] = sample.pulled(upstream);
                for k in 0..3 {
                    let [u, v] = [attributes[0][k].lanes(), attributes[1][k].lanes()];
                    at_corners[k] = by_u * u + by_v * v;
                }
                for (number, by_place) in [by_u, by_v].into_iter().enumerate() {
                    self.pull_attribute(number, share * by_place, weights);
                }
                if let Some(texels) = &mut self.texels {
                    sample.pull_texels(share, upstream, texels);
                }
                (here, there) = (seen, between(weights, at_corners));
            } else {
                for (quad, attributes) in attributes.chunks(QUAD).enumerate() {
                    let upstream = self.upstream.groups::<T>(quad, at);
                    for (number, values) in attributes.iter().enumerate() {
                        let upstream = upstream[number % QUAD].value();
                        for k in 0..3 {
                            at_corners[k] = at_corners[k] + values[k].lanes().scale(upstream);
                        }
                        self.pull_attribute(QUAD * quad + number, share.scale(upstream), weights);
                    }
                }
                there = between(weights, at_corners);
                here = there;
            }
            // A share draws the image from what it is towards what the face shows.
            let draw = here - images[k];
            let (by_edge, by_depth) = (of_edge * draw, share * draw);
            let by_place = by_depth * block.by_depth[k].slope();
            // The nearness falls as the depth grows.
            let by_z = by_place.scale(T::Lanes::splat(blend.per_range).neg());
            // d z / d λₖ = -z² / zₖ, and the weights on the face are λₖ z / zₖ: so both change by λₖ as by its share of 1 / z.
            let mut by_part = [zero; 3];
            for k in 0..3 {
                by_part[k] = depth * (share * (at_corners[k] - there) - depth * by_z);
            }
            let per_depth =
                [face.per_depth[0].lanes(), face.per_depth[1].lanes(), face.per_depth[2].lanes()];
            let by_barycentric =
                [by_part[0] * per_depth[0], by_part[1] * per_depth[1], by_part[2] * per_depth[2]];
            let [_, x, y] = &face.planes;
            let planes = [
                [x[0].lanes(), x[1].lanes(), x[2].lanes()],
                [y[0].lanes(), y[1].lanes(), y[2].lanes()],
            ];
            let point = &block.point[k];
            let moved = point.pulled(planes, by_edge * block.edge_slope[k], by_barycentric);
            for j in 0..6 {
                self.corners[j] += moved[j].output();
            }
            for j in 0..3 {
                let by_depth = by_barycentric[j] * point.barycentric[j] * per_depth[j];
                self.corners[6 + j] += (zero - by_depth).output();
            }
            if let Some(tables) = &mut self.tables {
                let [edge, depth] = &mut **tables;
                pull_row(zero - by_edge, block.edge_t[k], &block.edge_row[k], edge);
                block.by_depth[k].pull(by_depth, depth);
            }
        }
    }

    #[inline(always)]
    fn ends(&mut self, scene: &Scene<T>, shown: &Shown<T>, first: usize) {
        self.flush(scene, shown, first);
        self.owner = None;
    }
}
