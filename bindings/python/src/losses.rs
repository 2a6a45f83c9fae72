//! Losses of silhouettes against targets, each with its gradient to the vertices from one walk over the faces.

use std::{
    borrow::Borrow,
    sync::{Arc, OnceLock},
};

use softrast_raster::{
    HostBackend, TConorm,
    low_level::{ElementaryOp, PixelLoss},
};

use crate::{
    guard::caught,
    knots::{Drawing, Knots},
    op::{Gradients, Op},
    passes::{Directions, Inputs, MISSING, Silhouettes, Tabled, only},
    store::{Store, View},
    taped::Taped,
};

/// Vertices `[views, 3, V]` and targets `[1 or views, height, width]` to losses `[views]`; kept are their gradients `[views, 3, V]`.
pub(crate) struct Losses {
    scene: Arc<Silhouettes>,
    loss: PixelLoss,
    of_images: Op,
    drawing: OnceLock<Drawing>,
}

impl Losses {
    /// The loss of a renderer without a surrogate, under the probabilistic sum: others have none of their own.
    pub(crate) fn new(scene: &Arc<Silhouettes>, loss: PixelLoss) -> Option<Self> {
        let of_images = Op::elementary(ElementaryOp::Loss(loss));
        let whole =
            scene.t_conorm == TConorm::Probabilistic && scene.renderer.surrogate().is_none();
        whole.then(|| Self { scene: scene.clone(), loss, of_images, drawing: OnceLock::new() })
    }

    /// The op of the loss, with a table of the renderer's φ; if it `keeps`, it computes the gradient too.
    fn tabled<S: Store>(&self, keeps: bool, beside: &S::Slice) -> Result<Tabled<'_, S>, String> {
        let drawing = match self.drawing.get() {
            Some(drawing) => drawing,
            None => {
                let Silhouettes { renderer, least_vertices, size, .. } = &*self.scene;
                let silhouette = caught(|| renderer.prepared::<HostBackend>(renderer.phi()))?;
                let op = silhouette.loss_op(self.loss).ok_or("the T-conorm has no loss")?;
                let rows = silhouette.profile().knots();
                let op = Op::loss(op, rows, *least_vertices, *size);
                let knots = Knots { op, rows, tables: Taped::Table(Box::new(silhouette)) };
                let drawing = Drawing::new(Arc::new(knots), renderer.phi())?;
                self.drawing.get_or_init(|| drawing)
            }
        };
        let op = &drawing.knots.op;
        Ok(Tabled::new(if keeps { op.keeping() } else { op.clone() }, 1, drawing, beside))
    }

    /// The losses and, if it `keeps`, their gradients.
    pub(crate) fn forward<S: Store>(
        &self,
        views: &[View<'_, S>],
        keeps: bool,
    ) -> Result<Vec<S::Owned>, String> {
        if !S::ON_HOST {
            return self.composed(views, keeps);
        }
        let of = self.tabled::<S>(keeps, views[0].values)?;
        let scene = of.scene(&[views[0].clone(), views[0].clone(), views[1].clone()]);
        if !keeps {
            return Ok(vec![of.op.forward(&scene)?]);
        }
        let ones = ones(views);
        let ones = View { dims: vec![views[0].dims[0]], values: ones.borrow() };
        let losses = of.op.forward(&scene)?;
        Ok(vec![losses, only::<S>(of.op.vjp(&scene, &ones, &[true, false, false])?)?])
    }

    /// As `forward`, of an op for the image and one for its loss.
    fn composed<S: Store>(
        &self,
        views: &[View<'_, S>],
        keeps: bool,
    ) -> Result<Vec<S::Owned>, String> {
        let (image, sums) = self.image(views)?;
        let pair = self.pair(views, &image);
        let mut found = vec![self.of_images.forward(&pair)?];
        if keeps {
            let ones = ones(views);
            let ones = View { dims: vec![views[0].dims[0]], values: ones.borrow() };
            let by_image = only::<S>(self.of_images.vjp(&pair, &ones, &[true, false])?)?;
            let by_image = View { dims: pair[0].dims.clone(), values: by_image.borrow() };
            let sums = View { dims: pair[0].dims.clone(), values: sums.borrow() };
            let gradients =
                self.scene.vjp(&self.inputs(views), &sums, &by_image, &[true, false])?;
            found.push(only::<S>(gradients.views)?);
        }
        Ok(found)
    }

    /// The shape of the value, if the inputs fit.
    pub(crate) fn dims<S: Store>(&self, views: &[View<'_, S>]) -> Result<Vec<usize>, String> {
        let image = self.scene.dims(&views[0]);
        self.of_images.shape(&[image, views[1].dims.clone()])
    }

    pub(crate) fn vjp<S: Store>(
        &self,
        views: &[View<'_, S>],
        kept: &View<'_, S>,
        upstream: &View<'_, S>,
        wanted: &[bool],
    ) -> Result<Gradients<S>, String> {
        if upstream.dims != self.dims(views)? || kept.dims != views[0].dims {
            return Err("a loss and its gradients are of other views".to_owned());
        }
        let to_vertices = wanted[0].then(|| S::scaled(kept.values, upstream.values));
        if !wanted[1] {
            return Ok(vec![to_vertices, None]);
        }
        let (image, _) = self.image(views)?;
        let pair = self.pair(views, &image);
        let mut found = self.of_images.vjp(&pair, upstream, &[false, true])?;
        Ok(vec![to_vertices, found.pop().flatten()])
    }

    /// By the chain rule over the image and its loss: the second derivative of the image, and that of the loss along its motion.
    pub(crate) fn vjp_of_vjp<S: Store>(
        &self,
        views: &[View<'_, S>],
        upstream: &View<'_, S>,
        directions: &[Option<&S::Slice>],
        wanted: &[bool],
    ) -> Result<Gradients<S>, String> {
        let (image, sums) = self.image(views)?;
        let pair = self.pair(views, &image);
        let inputs = self.inputs(views);
        let sums = View { dims: pair[0].dims.clone(), values: sums.borrow() };
        let (moved, curved);
        let mut along = [None, directions[1]];
        if directions[0].is_some() {
            let by_image = only::<S>(self.of_images.vjp(&pair, upstream, &[true, false])?)?;
            let by_image = View { dims: pair[0].dims.clone(), values: by_image.borrow() };
            let motion = Directions { views: vec![directions[0], None], phi: None };
            let flags = [wanted[0], false, true];
            let mut found = self.scene.vjp_of_vjp(&inputs, &sums, &by_image, motion, &flags)?;
            moved = found.views.pop().flatten().ok_or(MISSING)?;
            curved = found.views.into_iter().next().flatten();
            along[0] = Some(moved.borrow());
        } else {
            curved = None;
        }
        let flags = [wanted[0], wanted[1], wanted[2]];
        let mut found = self.of_images.vjp_of_vjp(&pair, upstream, &along, &flags)?;
        let to_vertices = found[0].take().map(|bent| {
            let bent = View { dims: pair[0].dims.clone(), values: bent.borrow() };
            let found = self.scene.vjp(&inputs, &sums, &bent, &[true, false])?;
            let bent = only::<S>(found.views)?;
            Ok::<_, String>(match curved {
                Some(curved) => S::sum(bent, curved.borrow()),
                None => bent,
            })
        });
        found[0] = to_vertices.transpose()?;
        Ok(found)
    }

    /// The image and its sums.
    fn image<S: Store>(&self, views: &[View<'_, S>]) -> Result<(S::Owned, S::Owned), String> {
        let found = self.scene.forward(&self.inputs(views), true)?;
        let [image, sums] = found.try_into().map_err(|_| "an image is missing")?;
        Ok((image, sums))
    }

    /// Inputs of the loss of images.
    fn pair<'a, S: Store>(&self, views: &[View<'a, S>], image: &'a S::Owned) -> [View<'a, S>; 2] {
        [View { dims: self.scene.dims(&views[0]), values: image.borrow() }, views[1].clone()]
    }

    /// Inputs of the scene.
    fn inputs<'a, S: Store>(&self, views: &[View<'a, S>]) -> Inputs<'a, S> {
        Inputs {
            views: vec![views[0].clone(), views[0].clone()],
            phi: self.scene.renderer.phi().to_vec(),
        }
    }
}

/// A factor of 1 for each view.
fn ones<S: Store>(views: &[View<'_, S>]) -> S::Owned {
    S::filled(1.0, views[0].dims[0], views[0].values)
}
