use std::{cell::RefCell, collections::BTreeMap};

use burn::tensor::{Element, Tensor, TensorData};
use softrast_raster::{RasterBackend, Silhouette};
use softrast_softness::EdgeSoftness;

use crate::{LearnedEdge, numbers};

/// A step of an inner loop, and what it is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// How many steps came before.
    pub number: usize,
    /// What the vector is that stands for the softness.
    pub of: Of,
}

/// What stands for a softness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// φ, by which derivatives are asked for.
    Phi,
    /// φ as mere numbers: what depends on it alone may be kept.
    Values,
    /// What [`Lesson::prepared`](crate::Lesson::prepared) gave.
    Prepared,
}

/// Silhouettes for every step of a run, whose support and knots suit the scale there.
#[derive(Clone, Debug)]
pub struct PreparedRun {
    silhouettes: Vec<DrawnAndFelt>,
    of_step: Vec<usize>,
    /// A learned vector, and tables of the steps that were drawn under it without a gradient to it.
    tables: RefCell<Tables>,
}

/// Silhouettes as they are drawn, and what the gradient is taken of, where that is not the image.
#[derive(Clone, Debug)]
pub(crate) struct DrawnAndFelt {
    pub(crate) drawn: Silhouette<EdgeSoftness>,
    pub(crate) felt: Option<Silhouette<EdgeSoftness>>,
}

#[derive(Clone, Debug, Default)]
struct Tables {
    learned: Vec<f64>,
    of_step: BTreeMap<usize, TensorData>,
}

impl PreparedRun {
    /// The silhouette of step k is `silhouettes[of_step[k]]`.
    pub(crate) fn new(silhouettes: Vec<DrawnAndFelt>, of_step: Vec<usize>) -> Self {
        Self { silhouettes, of_step, tables: RefCell::default() }
    }

    /// Coverage `[views, size, size]` of `vertices` `[views, vertices, 3]` at an inner step, the
    /// last one for later ones; with the gradient of the surrogate, if there is one.
    pub fn image<B: RasterBackend>(
        &self,
        edge: &LearnedEdge,
        vertices: Tensor<B, 3>,
        learned: &Tensor<B, 1>,
        step: Step,
    ) -> Tensor<B, 3> {
        let number = step.number.min(self.of_step.len() - 1);
        let table = match step.of {
            Of::Prepared => learned.clone().reshape([-1, 4]),
            Of::Phi => self.table(edge, learned, number),
            Of::Values => {
                let mut tables = self.tables.borrow_mut();
                let values = numbers(learned.clone());
                if tables.learned != values {
                    *tables = Tables { learned: values, of_step: BTreeMap::new() };
                }
                let table = tables
                    .of_step
                    .entry(edge.stage(number))
                    .or_insert_with(|| self.table(edge, learned, number).into_data());
                let dtype = <B::FloatElem as Element>::dtype();
                Tensor::from_data(table.clone(), (&learned.device(), dtype))
            }
        };
        let DrawnAndFelt { drawn, felt } = &self.silhouettes[self.of_step[number]];
        let Some(felt) = felt else { return drawn.coverage_by_table(vertices, table) };
        let ([rows, _], own) = (table.dims(), drawn.profile().knots());
        let felt_table = table.clone().narrow(0, own, rows - own);
        drawn.coverage_with_surrogate(vertices, table.narrow(0, 0, own), felt, felt_table)
    }

    /// The table of a step, flat: all that [`image`](PreparedRun::image) needs of the softness.
    pub fn prepared<B: RasterBackend>(
        &self,
        edge: &LearnedEdge,
        learned: &Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 1> {
        let number = step.min(self.of_step.len() - 1);
        self.table(edge, learned, number).flatten(0, 1)
    }

    /// The table of a step, and below it that of the surrogate.
    fn table<B: RasterBackend>(
        &self,
        edge: &LearnedEdge,
        learned: &Tensor<B, 1>,
        number: usize,
    ) -> Tensor<B, 2> {
        let DrawnAndFelt { drawn, felt } = &self.silhouettes[self.of_step[number]];
        let table = drawn.table(edge.phi(learned, number));
        match felt.iter().zip(edge.felt(learned, number)).next() {
            None => table,
            Some((felt, (_, phi))) => Tensor::cat(vec![table, felt.table(phi)], 0),
        }
    }
}
