//! Problems with bounds or inequalities.

use super::{check, check_one_of};
use crate::optimization::ipm::tests::program::{INF, Program};

#[test]
fn hs1() {
    let program = Program::new(&[-2.0, 1.0])
        .minimize(|x| 100.0 * (x[1] - x[0].powi(2)).powi(2) + (1.0 - x[0]).powi(2))
        .bounds(1, -1.5, INF);
    check(program, 0.0);
}

#[test]
fn hs10() {
    let program = Program::new(&[-10.0, 10.0])
        .minimize(|x| x[0] - x[1])
        .positive(|x| -3.0 * x[0].powi(2) + 2.0 * x[0] * x[1] - x[1].powi(2) + 1.0);
    check(program, -1.0);
}

#[test]
fn hs11() {
    let program = Program::new(&[4.9, 0.1])
        .minimize(|x| (x[0] - 5.0).powi(2) + x[1].powi(2) - 25.0)
        .positive(|x| -(x[0].powi(2)) + x[1]);
    check(program, -8.498464223);
}

#[test]
fn hs12() {
    let program = Program::new(&[0.0, 0.0])
        .minimize(|x| 0.5 * x[0].powi(2) + x[1].powi(2) - x[0] * x[1] - 7.0 * x[0] - 7.0 * x[1])
        .positive(|x| 25.0 - 4.0 * x[0].powi(2) - x[1].powi(2));
    check(program, -30.0);
}

#[test]
fn hs14() {
    let program = Program::new(&[2.0, 2.0])
        .minimize(|x| (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2))
        .equal(|x| x[0] - 2.0 * x[1] + 1.0)
        .positive(|x| -0.25 * x[0].powi(2) - x[1].powi(2) + 1.0);
    check(program, 9.0 - 2.875 * 7.0_f64.sqrt());
}

#[test]
fn hs15() {
    let program = Program::new(&[-2.0, 1.0])
        .minimize(|x| 100.0 * (x[1] - x[0].powi(2)).powi(2) + (1.0 - x[0]).powi(2))
        .positive(|x| x[0] * x[1] - 1.0)
        .positive(|x| x[0] + x[1].powi(2))
        .bounds(0, -INF, 0.5);
    check(program, 306.5);
}

#[test]
fn hs16() {
    let program = Program::new(&[-2.0, 1.0])
        .minimize(|x| 100.0 * (x[1] - x[0].powi(2)).powi(2) + (1.0 - x[0]).powi(2))
        .positive(|x| x[0] + x[1].powi(2))
        .positive(|x| x[0].powi(2) + x[1])
        .bounds(0, -0.5, 0.5)
        .bounds(1, -INF, 1.0);
    // (1/2, 1/4), and a local minimum on x_1 = -x_2².
    check_one_of(program, &[0.25, 23.144_660_9]);
}

#[test]
fn hs21() {
    let program = Program::new(&[-1.0, -1.0])
        .minimize(|x| 0.01 * x[0].powi(2) + x[1].powi(2) - 100.0)
        .positive(|x| 10.0 * x[0] - x[1] - 10.0)
        .bounds(0, 2.0, 50.0)
        .bounds(1, -50.0, 50.0);
    check(program, -99.96);
}

#[test]
fn hs24() {
    let root = 3.0_f64.sqrt();
    let program = Program::new(&[1.0, 0.5])
        .minimize(move |x| ((x[0] - 3.0).powi(2) - 9.0) * x[1].powi(3) / (27.0 * root))
        .positive(move |x| x[0] / root - x[1])
        .positive(move |x| x[0] + root * x[1])
        .positive(move |x| 6.0 - x[0] - root * x[1])
        .all_bounds(0.0, INF);
    check(program, -1.0);
}

#[test]
fn hs35() {
    let program = Program::new(&[0.5, 0.5, 0.5])
        .minimize(|x| {
            9.0 - 8.0 * x[0] - 6.0 * x[1] - 4.0 * x[2]
                + 2.0 * x[0].powi(2)
                + 2.0 * x[1].powi(2)
                + x[2].powi(2)
                + 2.0 * x[0] * x[1]
                + 2.0 * x[0] * x[2]
        })
        .positive(|x| 3.0 - x[0] - x[1] - 2.0 * x[2])
        .all_bounds(0.0, INF);
    check(program, 1.0 / 9.0);
}

#[test]
fn hs43() {
    let program = Program::new(&[0.0, 0.0, 0.0, 0.0])
        .minimize(|x| {
            x[0].powi(2) + x[1].powi(2) + 2.0 * x[2].powi(2) + x[3].powi(2)
                - 5.0 * x[0]
                - 5.0 * x[1]
                - 21.0 * x[2]
                + 7.0 * x[3]
        })
        .positive(|x| {
            8.0 - x[0].powi(2) - x[1].powi(2) - x[2].powi(2) - x[3].powi(2) - x[0] + x[1] - x[2]
                + x[3]
        })
        .positive(|x| {
            10.0 - x[0].powi(2) - 2.0 * x[1].powi(2) - x[2].powi(2) - 2.0 * x[3].powi(2)
                + x[0]
                + x[3]
        })
        .positive(|x| {
            5.0 - 2.0 * x[0].powi(2) - x[1].powi(2) - x[2].powi(2) - 2.0 * x[0] + x[1] + x[3]
        });
    check(program, -44.0);
}

#[test]
fn hs63() {
    let program = Program::new(&[2.0, 2.0, 2.0])
        .minimize(|x| {
            1000.0 - x[0].powi(2) - 2.0 * x[1].powi(2) - x[2].powi(2) - x[0] * x[1] - x[0] * x[2]
        })
        .equal(|x| 8.0 * x[0] + 14.0 * x[1] + 7.0 * x[2] - 56.0)
        .equal(|x| x[0].powi(2) + x[1].powi(2) + x[2].powi(2) - 25.0)
        .all_bounds(0.0, INF);
    check(program, 961.7151721);
}

#[test]
fn hs65() {
    let program = Program::new(&[-5.0, 5.0, 0.0])
        .minimize(|x| {
            (x[0] - x[1]).powi(2) + (x[0] + x[1] - 10.0).powi(2) / 9.0 + (x[2] - 5.0).powi(2)
        })
        .positive(|x| 48.0 - x[0].powi(2) - x[1].powi(2) - x[2].powi(2))
        .all_bounds(-4.5, 4.5)
        .bounds(2, -5.0, 5.0);
    check(program, 0.9535288567);
}

#[test]
fn hs76() {
    let program = Program::new(&[0.5, 0.5, 0.5, 0.5])
        .minimize(|x| {
            x[0].powi(2) + 0.5 * x[1].powi(2) + x[2].powi(2) + 0.5 * x[3].powi(2) - x[0] * x[2]
                + x[2] * x[3]
                - x[0]
                - 3.0 * x[1]
                + x[2]
                - x[3]
        })
        .positive(|x| 5.0 - x[0] - 2.0 * x[1] - x[2] - x[3])
        .positive(|x| 4.0 - 3.0 * x[0] - x[1] - 2.0 * x[2] + x[3])
        .positive(|x| x[1] + 4.0 * x[2] - 1.5)
        .all_bounds(0.0, INF);
    check(program, -4.681818181);
}

#[test]
fn hs80() {
    let program = Program::new(&[-2.0, 2.0, 2.0, -1.0, -1.0])
        .minimize(|x| (x[0] * x[1] * x[2] * x[3] * x[4]).exp())
        .equal(|x| x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) + x[4].powi(2) - 10.0)
        .equal(|x| x[1] * x[2] - 5.0 * x[3] * x[4])
        .equal(|x| x[0].powi(3) + x[1].powi(3) + 1.0)
        .all_bounds(-3.2, 3.2)
        .bounds(0, -2.3, 2.3)
        .bounds(1, -2.3, 2.3);
    check(program, 0.0539498478);
}

#[test]
fn hs81() {
    let program = Program::new(&[-2.0, 2.0, 2.0, -1.0, -1.0])
        .minimize(|x| {
            (x[0] * x[1] * x[2] * x[3] * x[4]).exp()
                - 0.5 * (x[0].powi(3) + x[1].powi(3) + 1.0).powi(2)
        })
        .equal(|x| x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) + x[4].powi(2) - 10.0)
        .equal(|x| x[1] * x[2] - 5.0 * x[3] * x[4])
        .equal(|x| x[0].powi(3) + x[1].powi(3) + 1.0)
        .all_bounds(-3.2, 3.2)
        .bounds(0, -2.3, 2.3)
        .bounds(1, -2.3, 2.3);
    check(program, 0.0539498478);
}

#[test]
fn hs93() {
    let program = Program::new(&[5.54, 4.4, 12.02, 11.82, 0.702, 0.852])
        .minimize(|x| {
            0.0204 * x[0] * x[3] * (x[0] + x[1] + x[2])
                + 0.0187 * x[1] * x[2] * (x[0] + 1.57 * x[1] + x[3])
                + 0.0607 * x[0] * x[3] * x[4].powi(2) * (x[0] + x[1] + x[2])
                + 0.0437 * x[1] * x[2] * x[5].powi(2) * (x[0] + 1.57 * x[1] + x[3])
        })
        .positive(|x| 0.001 * x[0] * x[1] * x[2] * x[3] * x[4] * x[5] - 2.07)
        .positive(|x| {
            1.0 - 0.00062 * x[0] * x[3] * x[4].powi(2) * (x[0] + x[1] + x[2])
                - 0.00058 * x[1] * x[2] * x[5].powi(2) * (x[0] + 1.57 * x[1] + x[3])
        })
        .all_bounds(0.0, INF);
    check(program, 135.075961);
}

#[test]
fn hs100() {
    let program = Program::new(&[1.0, 2.0, 0.0, 4.0, 0.0, 1.0, 1.0])
        .minimize(|x| {
            (x[0] - 10.0).powi(2)
                + 5.0 * (x[1] - 12.0).powi(2)
                + x[2].powi(4)
                + 3.0 * (x[3] - 11.0).powi(2)
                + 10.0 * x[4].powi(6)
                + 7.0 * x[5].powi(2)
                + x[6].powi(4)
                - 4.0 * x[5] * x[6]
                - 10.0 * x[5]
                - 8.0 * x[6]
        })
        .positive(|x| {
            127.0 - 2.0 * x[0].powi(2) - 3.0 * x[1].powi(4) - x[2] - 4.0 * x[3].powi(2) - 5.0 * x[4]
        })
        .positive(|x| 282.0 - 7.0 * x[0] - 3.0 * x[1] - 10.0 * x[2].powi(2) - x[3] + x[4])
        .positive(|x| 196.0 - 23.0 * x[0] - x[1].powi(2) - 6.0 * x[5].powi(2) + 8.0 * x[6])
        .positive(|x| {
            -4.0 * x[0].powi(2) - x[1].powi(2) + 3.0 * x[0] * x[1] - 2.0 * x[2].powi(2) - 5.0 * x[5]
                + 11.0 * x[6]
        });
    check(program, 680.6300573);
}

#[test]
fn hs113() {
    let program = Program::new(&[2.0, 3.0, 5.0, 5.0, 1.0, 2.0, 7.0, 3.0, 6.0, 10.0])
        .minimize(|x| {
            x[0].powi(2) + x[1].powi(2) + x[0] * x[1] - 14.0 * x[0] - 16.0 * x[1]
                + (x[2] - 10.0).powi(2)
                + 4.0 * (x[3] - 5.0).powi(2)
                + (x[4] - 3.0).powi(2)
                + 2.0 * (x[5] - 1.0).powi(2)
                + 5.0 * x[6].powi(2)
                + 7.0 * (x[7] - 11.0).powi(2)
                + 2.0 * (x[8] - 10.0).powi(2)
                + (x[9] - 7.0).powi(2)
                + 45.0
        })
        .positive(|x| 105.0 - 4.0 * x[0] - 5.0 * x[1] + 3.0 * x[6] - 9.0 * x[7])
        .positive(|x| -10.0 * x[0] + 8.0 * x[1] + 17.0 * x[6] - 2.0 * x[7])
        .positive(|x| 8.0 * x[0] - 2.0 * x[1] - 5.0 * x[8] + 2.0 * x[9] + 12.0)
        .positive(|x| {
            -3.0 * (x[0] - 2.0).powi(2) - 4.0 * (x[1] - 3.0).powi(2) - 2.0 * x[2].powi(2)
                + 7.0 * x[3]
                + 120.0
        })
        .positive(|x| -5.0 * x[0].powi(2) - 8.0 * x[1] - (x[2] - 6.0).powi(2) + 2.0 * x[3] + 40.0)
        .positive(|x| {
            -0.5 * (x[0] - 8.0).powi(2) - 2.0 * (x[1] - 4.0).powi(2) - 3.0 * x[4].powi(2)
                + x[5]
                + 30.0
        })
        .positive(|x| {
            -(x[0].powi(2)) - 2.0 * (x[1] - 2.0).powi(2) + 2.0 * x[0] * x[1] - 14.0 * x[4]
                + 6.0 * x[5]
        })
        .positive(|x| 3.0 * x[0] - 6.0 * x[1] - 12.0 * (x[8] - 8.0).powi(2) + 7.0 * x[9]);
    check(program, 24.3062091);
}

#[test]
fn hs71() {
    let program = Program::new(&[1.0, 5.0, 5.0, 1.0])
        .minimize(|x| x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2])
        .positive(|x| x[0] * x[1] * x[2] * x[3] - 25.0)
        .equal(|x| x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) - 40.0)
        .all_bounds(1.0, 5.0);
    check(program, 17.0140173);
}

#[test]
fn hs106() {
    // The optimum to more digits: Liang et al. 2006, problem g10.
    let program = Program::new(&[5000.0, 5000.0, 5000.0, 200.0, 350.0, 150.0, 225.0, 425.0])
        .minimize(|x| x[0] + x[1] + x[2])
        .positive(|x| 1.0 - 0.0025 * (x[3] + x[5]))
        .positive(|x| 1.0 - 0.0025 * (x[4] + x[6] - x[3]))
        .positive(|x| 1.0 - 0.01 * (x[7] - x[4]))
        .positive(|x| x[0] * x[5] - 833.33252 * x[3] - 100.0 * x[0] + 83333.333)
        .positive(|x| x[1] * x[6] - 1250.0 * x[4] - x[1] * x[3] + 1250.0 * x[3])
        .positive(|x| x[2] * x[7] - 1250000.0 - x[2] * x[4] + 2500.0 * x[4])
        .all_bounds(10.0, 1000.0)
        .bounds(0, 100.0, 10000.0)
        .bounds(1, 1000.0, 10000.0)
        .bounds(2, 1000.0, 10000.0);
    check(program, 7_049.248_020_5);
}
