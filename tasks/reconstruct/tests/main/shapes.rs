use reconstruct::{Procedural, SIZE, Shapes, Split, VIEWS};

#[test]
fn every_picture_is_large_enough_to_learn_from_and_lies_within_its_frame() {
    let shapes = Procedural::new(Split::Train, 1, 3);
    for class in 0..shapes.classes().len() {
        for (shape, view) in [(0, 0), (1, 7), (2, 16)] {
            let planes = shapes.picture(class, shape, view % VIEWS).unwrap();
            let alpha = &planes[3 * SIZE * SIZE..];
            let count = alpha.iter().filter(|&&a| a > 0).count();
            assert!((150..2500).contains(&count), "class {class}: {count} pixels");
            let edge = |k: usize| {
                k / SIZE == 0 || k / SIZE == 63 || k.is_multiple_of(SIZE) || k % SIZE == 63
            };
            assert!((0..SIZE * SIZE).filter(|&k| edge(k)).all(|k| alpha[k] == 0));
        }
    }
}
