#!/bin/sh
# Installs packages, builds, and reconstructs two objects: one from four pictures, which the built-in model was not trained on, and one from
# 48 photographs. Fits both scenes. Writes the results to out/quickstart.
set -eu
cd "$(dirname "$0")/.."

cmake/install-packages.sh
cmake --preset release -DVSPLAT_TESTS=OFF -DVSPLAT_QUICK_BUILD=ON
cmake --build --preset release --target vsplat_cli

vsplat=build/release/bin/vsplat
out=out/quickstart
mkdir -p $out
$vsplat reconstruct examples/data/garden_gnome --output $out/gnome.ply --refine --refine-sheet $out/gnome-views.png \
  --render orbit:48 --turntable $out/gnome.webp --sheet $out/gnome.png --size 256x256 \
  --viewer $out/gnome.html --profile $out/profile.html --overwrite
$vsplat reconstruct examples/data/painted_skull --output $out/skull.ply --refine --refine-sheet $out/skull-views.png \
  --render orbit:48 --turntable $out/skull.webp --sheet $out/skull.png --size 256x256 \
  --viewer $out/skull.html --write-views $out/views --overwrite

echo
echo "Made in $out:"
echo "  gnome.ply        the scene made of the four pictures in examples/data/garden_gnome: any viewer of 3D Gaussian splats opens it"
echo "  gnome.html       the same in a page for the browser, by the network and after the fit, with the photographs"
echo "  gnome.webp       an animation that turns it around"
echo "  gnome.png        the same pictures side by side"
echo "  gnome-views.png  a row for each picture that was left out: the picture, the network's result, the fit's result, and the remaining difference"
echo "  skull.*          the same for the 48 photographs in examples/data/painted_skull"
echo "  views/           the network's input for the skull"
echo "  profile.html     where the time went for the gnome: open it in a browser"
echo "The model is small and sees pictures of 176 x 176 pixels; fine detail comes from the fit to the pictures (--refine)."
echo
echo "Open the scenes in a browser:"
echo "  $PWD/$out/gnome.html"
echo "  $PWD/$out/skull.html"
