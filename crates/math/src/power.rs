/// Returns 2 to the power of a number that is not positive, with a relative error of at most 2e-15;
/// numbers below -1000 are taken as -1000. The code has no branches and no fused arithmetic, so
/// that loops over it become vector instructions with the same bits on every processor.
///
/// ```
/// use tagalong_math::exp2_of_negative;
/// assert_eq!(exp2_of_negative(-3.0), 0.125);
/// ```
#[inline(always)]
pub fn exp2_of_negative(x: f64) -> f64 {
    // Adding this number rounds to an integer, which then stands in the low bits.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    // Powers below 2^-1022 would be subnormal, and are negligible beside other terms of a sum.
    let x = if x < -1000.0 { -1000.0 } else { x };
    let shifted = x + WHOLE;
    let rest = x - (shifted - WHOLE);
    let mut root = TERMS[0];
    for term in &TERMS[1..] {
        root = root * rest + term;
    }
    // The series of the fourth root needs five terms less than that of the power itself.
    let square = root * root;
    square * square * f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52)
}

/// Taylor series of 2^(r / 4), the last term first. The first omitted term is below 1e-17 for r up
/// to one half.
const TERMS: [f64; 10] = terms();

const fn terms() -> [f64; 10] {
    let mut terms = [1.0; 10];
    let mut term = 1.0;
    let mut i = 1;
    while i < terms.len() {
        term *= std::f64::consts::LN_2 / 4.0 / i as f64;
        terms[9 - i] = term;
        i += 1;
    }
    terms
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::exp2_of_negative;

    proptest! {
        #[test]
        fn a_power_is_right_to_the_last_digits(x in -1000.0..=0.0f64) {
            prop_assert!((exp2_of_negative(x) / x.exp2() - 1.0).abs() < 2e-15, "{}", x);
        }
    }

    #[test]
    fn powers_end_at_one_and_at_nothing() {
        assert_eq!((exp2_of_negative(0.0), exp2_of_negative(-0.0)), (1.0, 1.0));
        assert!(exp2_of_negative(-1e300) < 1e-300 && exp2_of_negative(f64::NEG_INFINITY) >= 0.0);
        assert!(exp2_of_negative(f64::NAN).is_nan());
    }
}
