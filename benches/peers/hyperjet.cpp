// The Hessian of the double pendulum's Lagrangian by HyperJet, the same function as that of num_dual.rs, for `hessians.sh`, which builds
// this program in two ways.

#include <hyperjet/hyperjet.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>

using Number = hyperjet::DDScalar<2, double, 4>;

// The double pendulum's Lagrangian, unit masses and lengths in absolute angles.
Number pendulum(const std::array<Number, 4> &x) {
    Number a = x[2] * 0.0, b = x[2] * 0.0, height = x[0] * 0.0, l = x[0] * 0.0;
    for (int i = 0; i < 2; i++) {
        const Number sine = x[i].sin(), cosine = x[i].cos();
        a += x[2 + i] * cosine;
        b += x[2 + i] * sine;
        height += cosine;
        l += (a * a + b * b) * 0.5 + height * 9.8;
    }
    return l;
}

int main() {
    std::array<double, 4> x;
    for (int i = 0; i < 4; i++) {
        x[i] = std::sin(0.37 * i + 0.3);
    }
    const auto call = [&] {
        // The compiler knows nothing of the numbers, and leaves out none of the results.
        asm volatile("" : : "r"(&x) : "memory");
        const Number l = pendulum(Number::variables<4>(x));
        asm volatile("" : : "r"(&l) : "memory");
        return l;
    };
    const Number l = call();
    // d2L/dv dv is known.
    const double errors[] = {l.h(2, 2) - 2.0, l.h(2, 3) - std::cos(x[0] - x[1]), l.h(3, 3) - 1.0};
    if (!std::all_of(std::begin(errors), std::end(errors), [](double error) { return std::abs(error) < 1e-14; })) {
        return std::puts("another Hessian"), 1;
    }
    // Nanoseconds of a call: the least of many rounds.
    double least = 1e300;
    for (int round = 0; round < 200; round++) {
        const auto start = std::chrono::steady_clock::now();
        for (int k = 0; k < 1000; k++) {
            call();
        }
        least = std::min(least, std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start).count() / 1000);
    }
    std::printf("  double pendulum: %.0f ns\n", least);
}
