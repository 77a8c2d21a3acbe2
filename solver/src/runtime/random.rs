//! Numbers that look random and depend on nothing but their seeds.

/// The output function of SplitMix64 (Steele, Lea and Flood 2014): one to one, and every bit of the result depends on all
/// of `seed`.
pub fn mix(seed: u64) -> u64 {
    let z = (seed ^ (seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The next 64 bits of a generator in this state: SplitMix64 itself.
pub fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    mix(*state)
}

#[cfg(test)]
mod tests {
    use super::next;

    /// The first numbers of the reference implementation (Vigna 2015) from the seed 1234567.
    #[test]
    fn it_is_split_mix() {
        let mut state = 1_234_567;
        let numbers = [0; 3].map(|_: u64| next(&mut state));
        assert_eq!(
            numbers,
            [
                6_457_827_717_110_365_317,
                3_203_168_211_198_807_973,
                9_817_491_932_198_370_423
            ]
        );
    }
}
