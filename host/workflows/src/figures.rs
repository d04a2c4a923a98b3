/// Rounds to this many decimals, so that a report does not exceed its precision.
pub fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    (value * scale).round() / scale
}

/// Most decimals in addition: doubles have no more digits.
const MOST_ZEROS: f64 = 12.0;
/// Most digits before the point of usual sizes.
const USUAL_DIGITS: f64 = 3.0;

/// [`rounded`] with one more decimal for each zero after the point of `size`, so that micrometres in mm keep their digits, and one less
/// for each digit before it above three.
pub fn rounded_for(size: f64, value: f64, decimals: i32) -> f64 {
    let zeros = (-size.abs().log10()).ceil() - 1.0;
    let more = if size == 0.0 { 0 } else { zeros.clamp(0.0, MOST_ZEROS) as i32 };
    let fewer = (-zeros - USUAL_DIGITS).clamp(0.0, MOST_ZEROS) as i32;
    rounded(value, (decimals + more - fewer).max(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_sizes_keep_their_digits_and_usual_ones_their_decimals() {
        for size in [46.2, 1.0, 0.1272, 0.1] {
            assert_eq!(rounded_for(size, 910.136_96, 3), 910.137, "{size}");
        }
        assert_eq!(rounded_for(0.0006, 6.545_237_386, 3), 6.545_237);
        assert_eq!(rounded_for(6.5e-5, 6.543_21e-5, 4), 6.543e-5);
        assert_eq!(rounded_for(0.0, 0.0, 4), 0.0);
        assert_eq!(rounded_for(f64::NAN, 1.23, 1), 1.2);
        assert!(rounded_for(f64::NAN, f64::NAN, 3).is_nan());
    }

    #[test]
    fn large_sizes_have_no_digits_of_noise() {
        assert_eq!(rounded_for(0.0, f64::from(123.4_f32), 3), 123.4);
        assert_eq!(rounded_for(999.0, 111.398_636, 3), 111.399);
        assert_eq!(rounded_for(1001.0, 4_617.839_171, 3), 4_617.84);
        assert_eq!(rounded_for(4e6, 4_617_839.171, 3), 4_617_839.0);
    }
}
