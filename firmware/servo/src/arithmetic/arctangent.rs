//! The angle of a vector, for the few places outside the current loop that need one.

/// Rotations: the last one turns by 0.007 degrees.
const STEPS: usize = 14;

/// `atan(2^-n)`, 2^32 to a revolution.
const ANGLES: [u32; STEPS] = [
    0x2000_0000,
    0x12E4_051E,
    0x09FB_385B,
    0x0511_11D4,
    0x028B_0D43,
    0x0145_D7E1,
    0x00A2_F61E,
    0x0051_7C55,
    0x0028_BE53,
    0x0014_5F2F,
    0x000A_2F98,
    0x0005_17CC,
    0x0002_8BE6,
    0x0001_45F3,
];

/// Angle of the vector (x, y) from the x axis, counted towards y; 2^32 is one revolution. Within 0.008 degrees for vectors longer than
/// 2^16; some value for (0, 0). Fourteen steps, always.
#[inline]
pub(crate) fn arctangent(y: i32, x: i32) -> u32 {
    // The rotations lengthen the vector by 1.65; two bits of headroom, and the more of them below for the shifts.
    let (mut x, mut y) = (i64::from(x) << 16, i64::from(y) << 16);
    let mut angle = 0_u32;
    if x < 0 {
        (x, y) = (x.wrapping_neg(), y.wrapping_neg());
        angle = 1 << 31;
    }
    for (step, part) in (0_u32..).zip(ANGLES) {
        let (along, across) = (x >> step, y >> step);
        if y >= 0 {
            (x, y) = (x.wrapping_add(across), y.wrapping_sub(along));
            angle = angle.wrapping_add(part);
        } else {
            (x, y) = (x.wrapping_sub(across), y.wrapping_add(along));
            angle = angle.wrapping_sub(part);
        }
    }
    angle
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_that_of_the_arctangents() {
        for (step, part) in (0..).zip(ANGLES) {
            let exact = 2.0_f64.powi(-step).atan() / core::f64::consts::TAU * 2.0_f64.powi(32);
            assert!((f64::from(part) - exact).abs() <= 1.0, "{step}: {exact:X?}");
        }
    }

    #[test]
    fn the_angle_is_right_within_eight_thousandths_of_a_degree() {
        let mut largest = 0.0_f64;
        for length in [65_536.0, 1e6, 2_147_483_647.0] {
            for step in 0..100_000 {
                let exact = f64::from(step) * 0.003_6_f64;
                let (sine, cosine) = exact.to_radians().sin_cos();
                let angle = arctangent((length * sine).round() as i32, (length * cosine).round() as i32);
                let error = (f64::from(angle) / 2.0_f64.powi(32) * 360.0 - exact + 540.0).rem_euclid(360.0) - 180.0;
                largest = largest.max(error.abs());
            }
        }
        assert!((0.004..0.008).contains(&largest), "{largest}");
    }

    #[test]
    fn the_corners_of_the_range_do_not_overflow() {
        for (y, x, eighths) in
            [(i32::MIN, i32::MIN, 5), (i32::MAX, i32::MIN, 3), (i32::MIN, i32::MAX, 7), (i32::MAX, i32::MAX, 1)]
        {
            let error = arctangent(y, x).wrapping_sub(eighths << 29) as i32;
            assert!(error.abs() < 1 << 16, "{error}");
        }
    }
}
