#!/bin/sh
# Set-up, build and the main job on the bundled photographs. Leaves its results in out/quickstart.
set -eu
cd "$(dirname "$0")/.."

cmake/install-packages.sh
cmake --preset release -DVSPLAT_TESTS=OFF
cmake --build --preset release --target vsplat_cli

vsplat=build/release/bin/vsplat
out=out/quickstart
mkdir -p $out
$vsplat init small --seed 1 --output $out/small.safetensors --overwrite
$vsplat reconstruct examples/data/painted_skull --model $out/small.safetensors --output $out/skull.ply \
  --render orbit:8 --images $out/pictures --size 256x256 --write-views $out/views --profile $out/profile.json --overwrite

echo
echo "Made:"
echo "  $out/skull.ply        the scene: any viewer of 3D Gaussian splats opens it"
echo "  $out/pictures/        8 pictures of it from a circle about the object"
echo "  $out/views/           what the network saw of the photographs in examples/data/painted_skull"
echo "  $out/profile.json     every kernel's time"
echo "The model has random weights: until a trained one is shipped the scene means nothing."
