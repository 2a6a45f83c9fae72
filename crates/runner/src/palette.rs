/// Colour of a method in every chart, by the first word of its name; told apart also by those who
/// see no red.
///
/// Methods that are no softness family share one dark colour.
pub fn method_colour(method: &str) -> [u8; 3] {
    match method.split([' ', '-', '.']).next() {
        Some("learned") if method.starts_with("learned-mlp") => [170, 20, 60],
        Some("learned") if method.starts_with("learned-surrogate") => [110, 80, 190],
        Some("logistic") => [31, 96, 168],
        Some("gauss") => [86, 180, 233],
        Some("exp") => [0, 140, 100],
        Some("gamma") => [204, 121, 167],
        Some("mlp") => [196, 84, 24],
        _ => [40, 40, 40],
    }
}
