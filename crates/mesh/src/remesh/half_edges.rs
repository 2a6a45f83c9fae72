use crate::MeshError;

/// No half-edge, or none yet.
const NONE: u32 = u32::MAX;

/// Faces as half-edges: half-edge h lies in face h / 3 and begins at the corner h % 3 of it.
#[derive(Clone, Debug)]
pub(super) struct HalfEdges {
    /// Start vertex of each half-edge.
    pub(super) from: Vec<u32>,
    /// The opposite half-edge, in the neighbouring face.
    pub(super) twin: Vec<u32>,
    /// A half-edge that starts at each vertex.
    pub(super) of_vertex: Vec<u32>,
    /// Number of edges of each vertex.
    pub(super) valence: Vec<u32>,
    /// Whether a face has collapsed.
    pub(super) is_dead: Vec<bool>,
    /// Whether a vertex has no face, or has been merged into another.
    pub(super) is_gone: Vec<bool>,
}

/// The half-edge after this one in its face.
#[inline(always)]
pub(super) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before this one in its face.
#[inline(always)]
pub(super) fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

impl HalfEdges {
    /// Half-edges of faces over `vertices` vertices.
    ///
    /// # Errors
    ///
    /// If an edge does not have two faces in opposite directions, or the faces at a vertex do not form a single fan.
    pub(super) fn new(faces: &[[u32; 3]], vertices: usize) -> Result<Self, MeshError> {
        let from = faces.as_flattened().to_vec();
        let twin = twins(&from, vertices)?;
        let (mut of_vertex, mut valence) = (vec![NONE; vertices], vec![0; vertices]);
        for (h, &vertex) in from.iter().enumerate() {
            of_vertex[vertex as usize] = h as u32;
            valence[vertex as usize] += 1;
        }
        let is_gone = valence.iter().map(|&count| count == 0).collect();
        let is_dead = vec![false; faces.len()];
        let edges = Self { from, twin, of_vertex, valence, is_dead, is_gone };
        let whole = |vertex: &usize| {
            let count = edges.valence[*vertex];
            count == 0 || edges.around(*vertex as u32).count() == count as usize
        };
        match (0..vertices).find(|vertex| !whole(vertex)) {
            Some(vertex) => Err(MeshError::Branches { vertex }),
            None => Ok(edges),
        }
    }

    /// Number of faces, including dead ones.
    pub(super) fn faces(&self) -> usize {
        self.is_dead.len()
    }

    /// Half-edges that start at a vertex, once around.
    #[inline(always)]
    pub(super) fn around(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.of_vertex[vertex as usize];
        let turn = move |&h: &u32| {
            let h = self.twin[previous(h) as usize];
            (h != first).then_some(h)
        };
        std::iter::successors(Some(first), turn)
    }

    /// Makes two half-edges each other's twins.
    #[inline(always)]
    pub(super) fn join(&mut self, g: u32, h: u32) {
        (self.twin[g as usize], self.twin[h as usize]) = (h, g);
    }

    /// Vertices of each face.
    pub(super) fn corners(&self) -> &[[u32; 3]] {
        self.from.as_chunks().0
    }

    /// Removes dead faces and merged or unused vertices, with the vertices' numbers, `[vertices, width]`.
    pub(super) fn compact(&mut self, numbers: &mut Vec<f32>, width: usize) {
        let vertex_of = places(&self.is_gone);
        let face_of = places(&self.is_dead);
        for (vertex, &place) in vertex_of.iter().enumerate().filter(|(_, place)| **place != NONE) {
            let (to, h) = (place as usize, self.of_vertex[vertex]);
            numbers.copy_within(vertex * width..(vertex + 1) * width, to * width);
            self.of_vertex[to] = 3 * face_of[h as usize / 3] + h % 3;
            self.valence[to] = self.valence[vertex];
        }
        for (face, &place) in face_of.iter().enumerate().filter(|(_, place)| **place != NONE) {
            for k in 0..3 {
                let (h, to) = (3 * face + k, 3 * place as usize + k);
                let twin = self.twin[h];
                self.from[to] = vertex_of[self.from[h] as usize];
                self.twin[to] = 3 * face_of[twin as usize / 3] + twin % 3;
            }
        }
        let count = |places: &[u32]| places.iter().filter(|place| **place != NONE).count();
        let (vertices, faces) = (count(&vertex_of), count(&face_of));
        numbers.truncate(vertices * width);
        self.of_vertex.truncate(vertices);
        self.valence.truncate(vertices);
        self.from.truncate(3 * faces);
        self.twin.truncate(3 * faces);
        self.is_gone = vec![false; vertices];
        self.is_dead = vec![false; faces];
    }
}

/// New index of each item after removal of those in `left_out`, which get [`NONE`].
fn places(left_out: &[bool]) -> Vec<u32> {
    let mut count = 0;
    let mut place = |&out: &bool| {
        count += u32::from(!out);
        if out { NONE } else { count - 1 }
    };
    left_out.iter().map(&mut place).collect()
}

/// The twin of each half-edge.
fn twins(from: &[u32], vertices: usize) -> Result<Vec<u32>, MeshError> {
    let count = from.len() as u32;
    let ends = |h: u32| [from[h as usize], from[next(h) as usize]];
    let lower = |h: u32| ends(h).into_iter().min().unwrap_or_default() as usize;
    // Half-edges by the lower of their ends.
    let mut starts = vec![0u32; vertices + 1];
    (0..count).for_each(|h| starts[lower(h) + 1] += 1);
    (0..vertices).for_each(|v| starts[v + 1] += starts[v]);
    let (mut waiting, mut filled) = (vec![NONE; from.len()], starts.clone());
    let mut twin = vec![NONE; from.len()];
    for h in 0..count {
        let ([a, b], lower) = (ends(h), lower(h));
        let slots = starts[lower] as usize..filled[lower] as usize;
        let is_twin = |&&g: &&u32| twin[g as usize] == NONE && ends(g) == [b, a];
        match waiting[slots].iter().find(is_twin) {
            Some(&g) => (twin[g as usize], twin[h as usize]) = (h, g),
            None => {
                waiting[filled[lower] as usize] = h;
                filled[lower] += 1;
            }
        }
    }
    // With two twins each way between the same vertices, the pairing would be ambiguous.
    let open = (0..count).find(|&h| {
        let ([a, b], lower) = (ends(h), lower(h));
        let slots = starts[lower] as usize..filled[lower] as usize;
        let same = |&&g: &&u32| ends(g) == [a, b] || ends(g) == [b, a];
        twin[h as usize] == NONE || a == b || waiting[slots].iter().filter(same).count() > 1
    });
    match open {
        Some(h) => Err(MeshError::NotClosed { vertices: ends(h).map(|v| v as usize) }),
        None => Ok(twin),
    }
}
