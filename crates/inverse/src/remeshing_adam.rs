use rayon::prelude::*;
use softrast_mesh::{ClosedSurface, Mesh, MeshError, SurfaceGeometry, vectors::dot};
use softrast_raster::RasterBackend;
use softrast_tensor::{Backend, Element, Tensor, TensorData};

/// Decay rates of the mean gradient, and of the mean of its squared length.
const BETA: [f32; 2] = [0.7, 0.9];
/// Step of a vertex relative to the shortest target length of edges.
const RATE: f64 = 0.3;
/// Number of smoothings of the gradient, and fraction of the way to the mean of its neighbours in each.
const SMOOTHED: (usize, f32) = (2, 0.5);
/// Fraction of the way to the mean of its neighbours that a vertex moves along the surface after each step, which keeps triangles even.
const ALONG: f32 = 0.3;
/// Fraction of that way across the surface at the usual rate, proportional to the rate. At a quarter of this value the surface folds.
const ACROSS: f32 = 0.02;
/// Steps from one remeshing to the next.
const EVERY: usize = 3;
/// Factor of the edge length at the largest number of faces, because not all faces are equilateral.
const ROOM: f64 = 1.2;
/// Angle in radians by which the surface turns along an edge of the shortest target length, where edges are that short. Along an edge as
/// long as the curvature permits, the surface deviates by an eighth of this times the shortest length.
const TURN: f32 = 0.25;
/// Smoothings of the curvature, so that edges of neighbouring vertices have similar lengths.
const CURVATURE_SMOOTHED: usize = 3;
/// Least squared length of a gradient, so that a vertex without gradient does not move.
const LEAST: f32 = 1e-24;
/// Columns of optimiser state per vertex: mean gradient, and the mean of its squared length.
const STATE: usize = 4;
/// First column of the optimiser state.
const MOMENTS: usize = ClosedSurface::OWN;
/// First column of colours, if there are some: channels, their mean gradients, and the means of their squares.
const COLOURS: usize = MOMENTS + STATE;
/// Channels of a colour.
const CHANNELS: usize = 3;
/// Fraction of the way to the mean of its neighbours that a colour moves in each step, so that unseen parts take on the colours around
/// them.
const BLUR: f32 = 0.05;
/// Vertices per parallel task.
const AT_ONCE: usize = 1 << 11;
/// Step of a colour channel at the usual rate.
const RATE_OF_COLOURS: f32 = 0.05;

/// Adam for the vertices of a closed surface that is remeshed as it moves: every third step, short edges collapse, long ones are split, and
/// edges are flipped, towards a target length of edges. The state of the optimiser moves with the vertices.
///
/// The step of a vertex is proportional to the target length and independent of the scale of the loss: each vertex has one second moment,
/// that of the length of its gradient. The gradient is smoothed over neighbours, and after each step vertices move towards the mean of
/// their neighbours, mostly along the surface. A surface can therefore start coarse and far off: begin with long edges and few pixels, then
/// shorten the edges ([`set_length`](Self::set_length)).
///
/// It works with any loss of [`vertices`](Self::vertices) and [`faces`](Self::faces). Faces change, so draw them by `with_faces` of a
/// renderer.
///
/// ```
/// use softrast_tensor::{Autodiff, NdArray};
/// use softrast_inverse::RemeshingAdam;
/// use softrast_mesh::icosphere;
///
/// // From a sphere to an ellipsoid with half the height.
/// let mut shape = RemeshingAdam::new(&icosphere(2), 0.2)?;
/// for _ in 0..40 {
///     let vertices = shape.vertices::<Autodiff<NdArray>>(&Default::default()).require_grad();
///     let axes = |k| vertices.clone().narrow(2, k, 1).powi_scalar(2);
///     let off = (axes(0) + axes(1) + axes(2) * 4.0 - 1.0).powi_scalar(2).mean();
///     let gradient = vertices.grad(&off.backward()).unwrap();
///     shape.step(gradient);
/// }
/// let [low, high] = shape.mesh()?.bounds();
/// assert!((high[2] - low[2] - 1.0).abs() < 0.1 && high[0] > 0.9);
/// # Ok::<(), softrast_mesh::MeshError>(())
/// ```
///
/// Source: Palfinger 2022 (remeshing), Dunyach et al. 2013 (lengths by curvature) and Adam (Kingma and Ba 2015); the constants are our own.
#[derive(Clone, Debug)]
pub struct RemeshingAdam {
    surface: ClosedSurface,
    geometry: SurfaceGeometry,
    /// Shortest target length of edges.
    length: f64,
    /// Longest target length relative to the shortest.
    longest: f64,
    steps: usize,
    /// Relative to [`RATE`].
    rate: f64,
    most: usize,
    /// Relative to [`ACROSS`].
    smoothing: f64,
}

impl RemeshingAdam {
    /// Default of the largest number of faces.
    pub const MOST_FACES: usize = 200_000;
    /// Largest smoothing relative to the usual: a vertex then moves half the way to the mean of its neighbours.
    pub const SMOOTHEST: f64 = 25.0;

    /// An optimiser of the vertices of a mesh, with target edge length `length` in its units.
    ///
    /// # Errors
    ///
    /// If the mesh is not closed, or branches.
    ///
    /// # Panics
    ///
    /// If `length` is not positive and finite in 32 bits.
    pub fn new(mesh: &Mesh, length: f64) -> Result<Self, MeshError> {
        Ok(Self::of_surface(ClosedSurface::new(mesh, length, STATE)?, length))
    }

    /// An optimiser with a colour at each vertex, initially `colour`, which moves with the vertex.
    pub(crate) fn with_colours(
        mesh: &Mesh,
        length: f64,
        colour: [f32; CHANNELS],
    ) -> Result<Self, MeshError> {
        let surface = ClosedSurface::new(mesh, length, STATE + 3 * CHANNELS)?;
        let mut shape = Self::of_surface(surface, length);
        let width = shape.surface.width();
        for row in shape.surface.numbers_mut().chunks_exact_mut(width) {
            row[COLOURS..COLOURS + CHANNELS].copy_from_slice(&colour);
        }
        Ok(shape)
    }

    fn of_surface(surface: ClosedSurface, length: f64) -> Self {
        let geometry = SurfaceGeometry::new(surface.faces(), surface.columns::<3>(0));
        let (longest, rate, most, smoothing) = (1.0, 1.0, Self::MOST_FACES, 1.0);
        Self { surface, geometry, length, longest, steps: 0, rate, most, smoothing }
    }

    /// Sets the largest number of faces; edges become as long as it requires.
    #[must_use]
    pub fn with_most_faces(mut self, most: usize) -> Self {
        self.most = most;
        self
    }

    /// Lets target lengths of edges follow the curvature, from the length set, where the surface turns by a quarter of a radian or more along
    /// an edge of it, to `longest` times this length, where the surface is flat. A rough surface is curved everywhere.
    ///
    /// # Panics
    ///
    /// If `longest` is below 1 or not finite.
    #[must_use]
    pub fn with_longest(mut self, longest: f64) -> Self {
        assert!(longest >= 1.0 && longest.is_finite(), "edges of {longest} times the length");
        self.longest = longest;
        self
    }

    /// Sets the smoothing of the surface relative to the usual.
    ///
    /// # Panics
    ///
    /// If `smoothing` is not above 0 and at most [`SMOOTHEST`](Self::SMOOTHEST).
    #[must_use]
    pub fn with_smoothing(mut self, smoothing: f64) -> Self {
        assert!(smoothing > 0.0 && smoothing <= Self::SMOOTHEST, "smoothing by {smoothing}");
        self.smoothing = smoothing;
        self
    }

    /// Sets the step length relative to the usual: 1 at first, less to settle.
    ///
    /// # Panics
    ///
    /// If `rate` is not positive and finite.
    pub fn set_rate(&mut self, rate: f64) {
        assert!(rate > 0.0 && rate.is_finite(), "a rate of {rate}");
        self.rate = rate;
    }

    /// Sets the target length of edges, the shortest if lengths follow the curvature, in the units of the mesh.
    ///
    /// # Panics
    ///
    /// If `length` is not positive and finite in 32 bits.
    pub fn set_length(&mut self, length: f64) {
        self.surface.set_length(length);
        self.length = length;
    }

    /// Vertices of each face, counterclockwise from outside.
    pub fn faces(&self) -> &[[u32; 3]] {
        self.surface.faces()
    }

    /// Positions of the vertices, `[1, vertices, 3]`.
    pub fn vertices<B: Backend>(&self, device: &B::Device) -> Tensor<B, 3> {
        let positions = self.geometry.positions().to_vec();
        let shape = [1, positions.len() / 3, 3];
        let data = TensorData::new(positions, shape);
        Tensor::from_data(data, (device, <B::FloatElem as Element>::dtype()))
    }

    /// The current surface.
    ///
    /// # Errors
    ///
    /// If a position is not finite.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        self.surface.mesh()
    }

    /// Takes a step against a gradient with respect to the vertices, `[1, vertices, 3]`, and remeshes the surface after every third step.
    ///
    /// # Panics
    ///
    /// If the gradient has another shape than the vertices.
    pub fn step<B: RasterBackend>(&mut self, gradient: Tensor<B, 3>) {
        let expected = [1, self.surface.vertices(), 3];
        assert_eq!(gradient.dims(), expected, "the gradient to the vertices");
        self.step_by(gradient.into_data().iter().collect(), None);
    }

    /// Positions and normals.
    pub(crate) fn geometry(&self) -> &SurfaceGeometry {
        &self.geometry
    }

    /// Colours at the vertices, `[vertices, 3]`, of an optimiser with colours.
    pub(crate) fn colours(&self) -> Vec<f32> {
        self.surface.columns::<CHANNELS>(COLOURS)
    }

    /// [`Self::step`] against gradients with respect to the vertices and, if present, the colours, `[vertices, 3]` each. Colours stay
    /// between 0 and 1.
    pub(crate) fn step_by(&mut self, mut gradient: Vec<f32>, colours: Option<Vec<f32>>) {
        for _ in 0..SMOOTHED.0 {
            let away = self.geometry.umbrella(&gradient);
            gradient.iter_mut().zip(away).for_each(|(g, away)| *g += SMOOTHED.1 * away);
        }
        self.steps += 1;
        if let Some(gradient) = colours {
            let blurred = self.geometry.umbrella(&self.colours());
            self.step_colours(&gradient, &blurred);
        }
        self.step_vertices(&gradient);
        if self.steps.is_multiple_of(EVERY) {
            self.aim();
            self.surface.remesh(self.most);
            self.geometry =
                SurfaceGeometry::new(self.surface.faces(), self.surface.columns::<3>(0));
        } else {
            self.geometry.move_to(self.surface.faces(), self.surface.columns::<3>(0));
        }
    }

    /// Moves the vertices against a gradient, and towards the means of their neighbours.
    fn step_vertices(&mut self, gradient: &[f32]) {
        let Self { surface, geometry, .. } = self;
        let away = geometry.umbrella(geometry.positions());
        let power = |beta: f32| 1.0 - beta.powi(self.steps.min(1 << 20) as i32);
        let corrections = BETA.map(power);
        let (rate, length) = ((RATE * self.rate) as f32, self.length as f32);
        let across = ACROSS * (self.rate * self.smoothing) as f32;
        let width = surface.width();
        let rows = surface.numbers_mut().par_chunks_exact_mut(width).with_min_len(AT_ONCE);
        rows.enumerate().for_each(|(vertex, row)| {
            let (g, away) = (at(gradient, vertex), at(&away, vertex));
            let normal = at(geometry.normals(), vertex);
            let moments = &mut row[MOMENTS..MOMENTS + STATE];
            for k in 0..3 {
                moments[k] += (1.0 - BETA[0]) * (g[k] - moments[k]);
            }
            moments[3] += (1.0 - BETA[1]) * (dot(g, g) - moments[3]);
            let size = (moments[3] / corrections[1]).max(LEAST).sqrt();
            let mean = [moments[0], moments[1], moments[2]];
            let step = rate * length / (size * corrections[0]);
            let out = dot(away, normal);
            for k in 0..3 {
                let along = away[k] - out * normal[k];
                row[k] += ALONG * along + across * out * normal[k] - step * mean[k];
            }
        });
    }

    /// Sets the target length of edges around each vertex: by the curvature if it matters, and longer if there would be too many faces.
    fn aim(&mut self) {
        self.surface.set_length(self.length);
        let width = self.surface.width();
        if self.longest > 1.0 {
            let (shortest, longest) = (self.length as f32, (self.longest * self.length) as f32);
            let curvatures = self.geometry.curvatures(CURVATURE_SMOOTHED);
            let rows = self.surface.numbers_mut().chunks_exact_mut(width);
            for (row, curvature) in rows.zip(curvatures) {
                // An edge of length l deviates by l² c / 8 from a surface of curvature c.
                let length = (TURN * shortest / curvature.max(f32::MIN_POSITIVE)).sqrt();
                row[ClosedSurface::LENGTH] = length.clamp(shortest, longest);
            }
        }
        let longer = (ROOM * (self.surface.wanted_faces() / self.most as f64).sqrt()) as f32;
        if longer > 1.0 {
            let rows = self.surface.numbers_mut().chunks_exact_mut(width);
            rows.for_each(|row| row[ClosedSurface::LENGTH] *= longer);
        }
    }

    /// Moves the colours against a gradient, and towards the means of their neighbours.
    fn step_colours(&mut self, gradient: &[f32], away: &[f32]) {
        let rate = RATE_OF_COLOURS * self.rate.sqrt() as f32;
        let width = self.surface.width();
        let rows = self.surface.numbers_mut().par_chunks_exact_mut(width).with_min_len(AT_ONCE);
        rows.enumerate().for_each(|(vertex, row)| {
            let (gradient, away) = (at(gradient, vertex), at(away, vertex));
            let (colours, moments) = row[COLOURS..].split_at_mut(CHANNELS);
            let (means, squares) = moments.split_at_mut(CHANNELS);
            for k in 0..CHANNELS {
                means[k] += (1.0 - BETA[0]) * (gradient[k] - means[k]);
                squares[k] += (1.0 - BETA[1]) * (gradient[k] * gradient[k] - squares[k]);
                let step = rate * means[k] / squares[k].max(LEAST).sqrt();
                colours[k] = (colours[k] + BLUR * away[k] - step).clamp(0.0, 1.0);
            }
        });
    }
}

/// The three numbers of a vertex.
#[inline(always)]
fn at(numbers: &[f32], vertex: usize) -> [f32; 3] {
    [numbers[3 * vertex], numbers[3 * vertex + 1], numbers[3 * vertex + 2]]
}

#[cfg(test)]
mod tests;
