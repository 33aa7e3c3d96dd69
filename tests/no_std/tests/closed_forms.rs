//! The library without the standard library, under a test program that has it.

#[test]
fn terms_and_derivatives_agree_with_closed_forms() {
    for difference in [lnn_no_std::accelerations().unwrap(), lnn_no_std::pendula().unwrap()].concat() {
        assert!(difference < 1e-12, "{difference}");
    }
    let (slopes, hessian) = (lnn_no_std::linearization().unwrap(), lnn_no_std::hessian().unwrap());
    assert!(slopes < 1e-7 && hessian < 1e-12, "{slopes} {hessian}");
    assert!(lnn_no_std::agrees());
}
