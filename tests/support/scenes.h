// Random scenes and cameras, from the self-test.
#pragma once
#include "model/diagnose/selftest/inputs/random_scenes.h"

namespace vsplat::test {

using selftest::look_at;
using selftest::make_camera;
using selftest::make_scene;
using selftest::make_surfels;
using selftest::scene_cases;
using selftest::SceneCase;

}  // namespace vsplat::test
