#!/bin/sh
# Makes viewer.js from src/ and the versions of package-lock.json. Needs Node 18 and npm, which building vsplat does not.
#   model/cli/viewer/build.sh            writes viewer.js
#   model/cli/viewer/build.sh --check    fails unless viewer.js is what would be written
set -eu
cd "$(dirname "$0")"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cp -r package.json package-lock.json bundle.mjs src "$folder"
cd "$folder"
npm ci --no-audit --no-fund --ignore-scripts >/dev/null
{
  echo '/*! Made by model/cli/viewer/build.sh. Do not edit. Contains the PlayCanvas engine:'
  sed 's/\*\//* \//' node_modules/playcanvas/LICENSE
  echo '*/'
} >licence.txt
node bundle.mjs
cat licence.txt bundle.js >viewer.js
cd "$OLDPWD"
if [ "${1-}" = --check ]; then
  cmp "$folder/viewer.js" viewer.js
else
  cp "$folder/viewer.js" viewer.js
fi
