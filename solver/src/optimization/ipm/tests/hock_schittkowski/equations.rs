//! Problems with equations only.

use super::check;
use crate::optimization::ipm::tests::program::Program;

#[test]
fn hs6() {
    let program = Program::new(&[-1.2, 1.0])
        .minimize(|x| (1.0 - x[0]).powi(2))
        .equal(|x| 10.0 * (x[1] - x[0].powi(2)));
    check(program, 0.0);
}

#[test]
fn hs7() {
    let program = Program::new(&[2.0, 2.0])
        .minimize(|x| (1.0 + x[0].powi(2)).ln() - x[1])
        .equal(|x| (1.0 + x[0].powi(2)).powi(2) + x[1].powi(2) - 4.0);
    check(program, -(3.0_f64.sqrt()));
}

#[test]
fn hs9() {
    use std::f64::consts::PI;
    let program = Program::new(&[0.0, 0.0])
        .minimize(|x| (PI / 12.0 * x[0]).sin() * (PI / 16.0 * x[1]).cos())
        .equal(|x| 4.0 * x[0] - 3.0 * x[1]);
    check(program, -0.5);
}

#[test]
fn hs26() {
    let program = Program::new(&[-2.6, 2.0, 2.0])
        .minimize(|x| (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(4))
        .equal(|x| (1.0 + x[1].powi(2)) * x[0] + x[2].powi(4) - 3.0);
    check(program, 0.0);
}

#[test]
fn hs27() {
    let program = Program::new(&[2.0, 2.0, 2.0])
        .minimize(|x| 0.01 * (x[0] - 1.0).powi(2) + (x[1] - x[0].powi(2)).powi(2))
        .equal(|x| x[0] + x[2].powi(2) + 1.0);
    check(program, 0.04);
}

#[test]
fn hs28() {
    let program = Program::new(&[-4.0, 1.0, 1.0])
        .minimize(|x| (x[0] + x[1]).powi(2) + (x[1] + x[2]).powi(2))
        .equal(|x| x[0] + 2.0 * x[1] + 3.0 * x[2] - 1.0);
    check(program, 0.0);
}

#[test]
fn hs39() {
    let program = Program::new(&[2.0, 2.0, 2.0, 2.0])
        .minimize(|x| -x[0])
        .equal(|x| x[1] - x[0].powi(3) - x[2].powi(2))
        .equal(|x| x[0].powi(2) - x[1] - x[3].powi(2));
    check(program, -1.0);
}

#[test]
fn hs40() {
    let program = Program::new(&[0.8, 0.8, 0.8, 0.8])
        .minimize(|x| -x[0] * x[1] * x[2] * x[3])
        .equal(|x| x[0].powi(3) + x[1].powi(2) - 1.0)
        .equal(|x| x[0].powi(2) * x[3] - x[2])
        .equal(|x| x[3].powi(2) - x[1]);
    check(program, -0.25);
}

#[test]
fn hs46() {
    let program = Program::new(&[0.5 * 2.0_f64.sqrt(), 1.75, 0.5, 2.0, 2.0])
        .minimize(|x| {
            (x[0] - x[1]).powi(2)
                + (x[2] - 1.0).powi(2)
                + (x[3] - 1.0).powi(4)
                + (x[4] - 1.0).powi(6)
        })
        .equal(|x| x[0].powi(2) * x[3] + (x[3] - x[4]).sin() - 1.0)
        .equal(|x| x[1] + x[2].powi(4) * x[3].powi(2) - 2.0);
    check(program, 0.0);
}

#[test]
fn hs48() {
    let program = Program::new(&[3.0, 5.0, -3.0, 2.0, -2.0])
        .minimize(|x| (x[0] - 1.0).powi(2) + (x[1] - x[2]).powi(2) + (x[3] - x[4]).powi(2))
        .equal(|x| x[0] + x[1] + x[2] + x[3] + x[4] - 5.0)
        .equal(|x| x[2] - 2.0 * (x[3] + x[4]) + 3.0);
    check(program, 0.0);
}

#[test]
fn hs50() {
    let program = Program::new(&[35.0, -31.0, 11.0, 5.0, -5.0])
        .minimize(|x| {
            (x[0] - x[1]).powi(2)
                + (x[1] - x[2]).powi(2)
                + (x[2] - x[3]).powi(4)
                + (x[3] - x[4]).powi(2)
        })
        .equal(|x| x[0] + 2.0 * x[1] + 3.0 * x[2] - 6.0)
        .equal(|x| x[1] + 2.0 * x[2] + 3.0 * x[3] - 6.0)
        .equal(|x| x[2] + 2.0 * x[3] + 3.0 * x[4] - 6.0);
    check(program, 0.0);
}

#[test]
fn hs51() {
    let program = Program::new(&[2.5, 0.5, 2.0, -1.0, 0.5])
        .minimize(|x| {
            (x[0] - x[1]).powi(2)
                + (x[1] + x[2] - 2.0).powi(2)
                + (x[3] - 1.0).powi(2)
                + (x[4] - 1.0).powi(2)
        })
        .equal(|x| x[0] + 3.0 * x[1] - 4.0)
        .equal(|x| x[2] + x[3] - 2.0 * x[4])
        .equal(|x| x[1] - x[4]);
    check(program, 0.0);
}

#[test]
fn hs52() {
    let program = Program::new(&[2.0, 2.0, 2.0, 2.0, 2.0])
        .minimize(|x| {
            (4.0 * x[0] - x[1]).powi(2)
                + (x[1] + x[2] - 2.0).powi(2)
                + (x[3] - 1.0).powi(2)
                + (x[4] - 1.0).powi(2)
        })
        .equal(|x| x[0] + 3.0 * x[1])
        .equal(|x| x[2] + x[3] - 2.0 * x[4])
        .equal(|x| x[1] - x[4]);
    check(program, 1859.0 / 349.0);
}

#[test]
fn hs77() {
    let program = Program::new(&[2.0, 2.0, 2.0, 2.0, 2.0])
        .minimize(|x| {
            (x[0] - 1.0).powi(2)
                + (x[0] - x[1]).powi(2)
                + (x[2] - 1.0).powi(2)
                + (x[3] - 1.0).powi(4)
                + (x[4] - 1.0).powi(6)
        })
        .equal(|x| x[0].powi(2) * x[3] + (x[3] - x[4]).sin() - 2.0 * 2.0_f64.sqrt())
        .equal(|x| x[1] + x[2].powi(4) * x[3].powi(2) - 8.0 - 2.0_f64.sqrt());
    check(program, 0.24150513);
}

#[test]
fn hs78() {
    let program = Program::new(&[-2.0, 1.5, 2.0, -1.0, -1.0])
        .minimize(|x| x[0] * x[1] * x[2] * x[3] * x[4])
        .equal(|x| x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) + x[4].powi(2) - 10.0)
        .equal(|x| x[1] * x[2] - 5.0 * x[3] * x[4])
        .equal(|x| x[0].powi(3) + x[1].powi(3) + 1.0);
    check(program, -2.91970041);
}

#[test]
fn hs79() {
    let program = Program::new(&[2.0, 2.0, 2.0, 2.0, 2.0])
        .minimize(|x| {
            (x[0] - 1.0).powi(2)
                + (x[0] - x[1]).powi(2)
                + (x[1] - x[2]).powi(2)
                + (x[2] - x[3]).powi(4)
                + (x[3] - x[4]).powi(4)
        })
        .equal(|x| x[0] + x[1].powi(2) + x[2].powi(3) - 2.0 - 3.0 * 2.0_f64.sqrt())
        .equal(|x| x[1] - x[2].powi(2) + x[3] + 2.0 - 2.0 * 2.0_f64.sqrt())
        .equal(|x| x[0] * x[4] - 2.0);
    check(program, 0.0787768209);
}
