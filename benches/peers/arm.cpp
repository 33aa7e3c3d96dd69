// Pinocchio on the arm of `cargo bench --bench systems -- seven`, for `arm.sh`, which builds this program in several ways. Reads what that
// benchmark prints of the arm without friction, torques, accelerations and da/dq, and compares before it times.

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/cholesky.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

using namespace pinocchio;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

const int N = 7;

// Every joint is visited as one of the types that the collection has. The library that Pinocchio ships knows the default collection, of 25
// types; without that library a collection of one type is compiled, which leaves out what this arm does not need.
#ifdef PINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION
using Arm = Model;
#else
template <typename Scalar, int Options> struct Turning : JointCollectionDefaultTpl<Scalar, Options> {
    using JointModelVariant = boost::variant<JointModelRevoluteTpl<Scalar, Options, 2>>;
    using JointDataVariant = boost::variant<JointDataRevoluteTpl<Scalar, Options, 2>>;
};
using Arm = ModelTpl<double, 0, Turning>;
#endif

enum Kind { XX, XY, XZ, YY, YZ, ZZ, MASS, X, Y, Z };

// The constants of the benchmark: those of all links stand one after the other, in the order of their names.
double constant(int kind, int link) {
    const double initial = kind == MASS ? 1.0 : kind == XX || kind == YY || kind == ZZ ? 0.1 : 0.0;
    return initial + 0.02 + 0.01 * std::sin(N * kind + link);
}

Arm arm() {
    // examples/systems/seven_joints.toml: a, alpha in quarter turns, d.
    const double rows[N][3] = {{0, 0, 0.333}, {0, -1, 0}, {0, 1, 0.316}, {0.0825, 1, 0}, {-0.0825, -1, 0.384}, {0, 1, 0}, {0.088, 1, 0}};
    Arm model;
    for (int i = 0; i < N; i++) {
        const auto [a, turn, d] = rows[i];
        Eigen::Matrix3d about;
        about << 1, 0, 0, 0, turn == 0, -turn, 0, turn, turn == 0;
        const auto joint = model.addJoint(i, JointModelRZ(), SE3(about, about * Vector3d(a, 0, d)), "q" + std::to_string(i + 1));
        const auto c = [i](int kind) { return constant(kind, i); };
        Eigen::Matrix3d inertia;
        inertia << c(XX), c(XY), c(XZ), c(XY), c(YY), c(YZ), c(XZ), c(YZ), c(ZZ);
        // Ours is about the origin of the frame, theirs about the centre of mass.
        const Vector3d centre = Vector3d(c(X), c(Y), c(Z)) / c(MASS);
        const Eigen::Matrix3d shift = skew(centre);
        model.appendBodyToJoint(joint, Inertia(c(MASS), centre, inertia + c(MASS) * shift * shift));
    }
    return model;
}

// Nanoseconds of a call: the least of many rounds.
template <typename Call> void time(const char *name, Call call) {
    double least = 1e300;
    for (int round = 0; round < 200; round++) {
        const auto start = std::chrono::steady_clock::now();
        for (int k = 0; k < 500; k++) {
            call();
            asm volatile("" ::: "memory");
        }
        least = std::min(least, std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count() / 500);
    }
    std::printf("  %s: %.0f ns\n", name, least);
}

MatrixXd given(int rows, int columns) {
    MatrixXd numbers(rows, columns);
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < columns; j++) {
            if (std::scanf("%lf", &numbers(i, j)) != 1) {
                std::exit((std::puts("expected 7 torques, 7 accelerations and 49 derivatives"), 1));
            }
        }
    }
    return numbers;
}

void agree(const char *what, const MatrixXd &found, const MatrixXd &expected) {
    const double error = (found - expected).cwiseAbs().maxCoeff() / std::max(1.0, expected.cwiseAbs().maxCoeff());
    std::printf("  %s differ by %.1e of the largest\n", what, error);
    if (!(error < 1e-10)) {
        std::exit(1);
    }
}

int main() {
    const Arm model = arm();
    Arm::Data data(model);
    const auto numbers = [](double shift) {
        VectorXd x(N);
        for (int i = 0; i < N; i++) {
            x[i] = std::sin(shift + 1.3 * i);
        }
        return x;
    };
    const VectorXd q = numbers(0.3), v = numbers(1.1), a = numbers(2.7), none = VectorXd::Zero(N);
    VectorXd found(N);
    const auto by_mass_matrix = [&] {
        crba(model, data, q, Convention::LOCAL);
        found = -nonLinearEffects(model, data, q, v);
        cholesky::decompose(model, data);
        cholesky::solve(model, data, found);
    };

    agree("torques", rnea(model, data, q, v, a), given(N, 1));
    const MatrixXd accelerations = given(N, 1), by_q = given(N, N);
    agree("accelerations", aba(model, data, q, v, none, Convention::LOCAL), accelerations);
    agree("accelerations, world", aba(model, data, q, v, none, Convention::WORLD), accelerations);
    by_mass_matrix();
    agree("accelerations by the mass matrix", found, accelerations);
    std::printf("  least pivot of the mass matrix %.2e\n", data.D.minCoeff());
    computeABADerivatives(model, data, q, v, none);
    agree("da/dq", data.ddq_dq, by_q);

    time("rnea", [&] { rnea(model, data, q, v, a); });
    time("aba", [&] { aba(model, data, q, v, none, Convention::LOCAL); });
    time("aba, world", [&] { aba(model, data, q, v, none, Convention::WORLD); });
    time("crba", [&] { crba(model, data, q, Convention::LOCAL); });
    time("crba, world", [&] { crba(model, data, q, Convention::WORLD); });
    time("crba, nonLinearEffects, Cholesky", by_mass_matrix);
    time("computeRNEADerivatives", [&] { computeRNEADerivatives(model, data, q, v, a); });
    time("computeABADerivatives", [&] { computeABADerivatives(model, data, q, v, none); });
}
