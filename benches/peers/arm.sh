#!/usr/bin/env bash
# Installs Pinocchio from its package registry into target/peers-hessians, compares it with what `cargo bench --bench systems -- seven` prints,
# and times both on the arm of that benchmark. Needs Python 3.10 or later, g++ and some minutes for the headers of Pinocchio.
set -euo pipefail
cd "$(dirname "$0")/../.."

folder=$PWD/target/peers-hessians
[ -x "$folder/bin/python" ] || python3 -m venv "$folder"
"$folder/bin/python" -m pip install --quiet libpinocchio==4.1.0 cmeel-boost==1.90.0 cmeel-eigen==3.4.1
prefix=$(echo "$folder"/lib/python3*/site-packages/cmeel.prefix)

cargo bench --locked --bench systems -- --warm-up-time 0.3 --measurement-time 1 seven | tee "$folder/arm.txt"
sed -n 's/.*, friction false: \[\(.*\)\]/\1/p' "$folder/arm.txt" | tr , ' ' > "$folder/arm.numbers"

# What Pinocchio's own build defines: its list of joints is longer than the lists of Boost.
limits="-DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_FUSION_INVOKE_MAX_ARITY=12"
build() { # NAME FLAGS
    # shellcheck disable=SC2086
    g++ -std=c++17 -O3 -DNDEBUG $limits -isystem "$prefix/include" -isystem "$prefix/include/eigen3" benches/peers/arm.cpp -o "$folder/$1" $2
    "$folder/$1" < "$folder/arm.numbers"
}
echo "Pinocchio, linked with the library it ships"
build arm-library "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION -L$prefix/lib -Wl,-rpath,$prefix/lib -lpinocchio_default"
echo "Pinocchio, its headers compiled for this processor, joints that turn alone"
build arm-headers "-march=native -DBOOST_VARIANT_USE_RELAXED_GET_BY_DEFAULT"
