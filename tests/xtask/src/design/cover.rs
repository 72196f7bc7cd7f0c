//! A set of inputs, said as few conditions.

/// A condition on each of some bits: those in `care` must be as in `value`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cube {
    pub(super) care: u32,
    pub(super) value: u32,
}

impl Cube {
    const fn holds(self, input: u32) -> bool {
        input & self.care == self.value
    }
}

/// Cubes that hold for every input of `inside` and for none of `outside`. All other inputs do not occur.
///
/// Bits are left out in the order of `dispensable`, first those that say least to a reader.
pub(super) fn cover(inside: &[u32], outside: &[u32], dispensable: &[u32]) -> Vec<Cube> {
    let mut cubes: Vec<Cube> = Vec::new();
    let all = dispensable.iter().fold(0, |all, bit| all | 1 << bit);
    for input in inside {
        if cubes.iter().any(|cube| cube.holds(*input)) {
            continue;
        }
        let mut cube = Cube { care: all, value: *input };
        for bit in dispensable {
            let care = cube.care & !(1 << bit);
            let wider = Cube { care, value: cube.value & care };
            if !outside.iter().any(|input| wider.holds(*input)) {
                cube = wider;
            }
        }
        cubes.push(cube);
    }
    // One that came first may be covered by those that came later.
    let mut number = 0;
    while number < cubes.len() {
        let others = |input: u32| cubes.iter().enumerate().any(|(other, cube)| other != number && cube.holds(input));
        if inside.iter().all(|input| others(*input)) {
            cubes.remove(number);
        } else {
            number += 1;
        }
    }
    cubes
}

#[test]
fn a_cover_holds_inside_and_nowhere_outside() {
    // Bit 0 or bits 1 and 2; the input 7 does not occur.
    let wanted = |input: u32| input & 1 != 0 || input & 6 == 6;
    let inside: Vec<u32> = (0..7).filter(|input| wanted(*input)).collect();
    let outside: Vec<u32> = (0..7).filter(|input| !wanted(*input)).collect();
    let cubes = cover(&inside, &outside, &[0, 1, 2]);
    assert_eq!(cubes, [Cube { care: 1, value: 1 }, Cube { care: 6, value: 6 }]);
}
