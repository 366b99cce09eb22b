// A picture's maps for LaRa's, and a loss on what comes of them, with its derivatives.
#pragma once
#include <cmath>

#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/lara_maps.h"

namespace vsplat::selftest {

// Smooth maps but for holes, a step and colours out of range.
struct LaraPicture {
  LaraPicture(int w, int h) : camera(make_camera({"", 0, 0, w, h, "off-centre"}, 7)) {
    const auto n = static_cast<std::size_t>(w) * static_cast<std::size_t>(h);
    colour = random_floats(3 * n, 1, -0.3f, 1.3f);
    normal = random_floats(3 * n, 2);
    alpha = random_floats(n, 3, 0.1f, 0.99f);
    const std::vector<float> rough = random_floats(n, 4, 0.0f, 0.05f);
    for (std::size_t i = 0; i < n; ++i) {
      const auto x = static_cast<float>(i % static_cast<std::size_t>(w)),
                 y = static_cast<float>(i) / static_cast<float>(w);
      if (i % 7 == 3) alpha[i] = 0;
      depth.push_back(alpha[i] * (1.5f + 0.03f * x - 0.02f * y + (x > 9 ? 0.5f : 0.0f) + rough[i]));
    }
    for (float& c : colour)
      if (std::abs(c) < 0.01f || std::abs(c - 1) < 0.01f) c = 0.5f;  // off the ends, for differences
  }

  ref::PictureMaps wide() const {
    const auto widened = [](const std::vector<float>& v) { return std::vector<double>(v.begin(), v.end()); };
    return {widened(colour), widened(alpha), widened(depth), widened(normal)};
  }

  Camera camera;
  std::vector<float> colour, alpha, depth, normal;
};

// Derivatives of a loss by LaRa's maps and by alpha.
struct LaraCotangent {
  std::vector<float> image, alpha, depth, normal, depth_normal;

  static LaraCotangent random(const LaraPicture& of) {
    const std::size_t n = of.alpha.size();
    return {random_floats(3 * n, 11), random_floats(n, 12), random_floats(n, 13), random_floats(3 * n, 14),
            random_floats(3 * n, 15)};
  }

  // The loss's by one of the picture's maps, by differences of the reference. The alphas that normals of depths are
  // multiplied by are held.
  std::vector<double> differences(const LaraPicture& of, std::vector<double> ref::PictureMaps::*field) const {
    const ref::PictureMaps given = of.wide();
    ref::PictureMaps maps = given;
    const auto loss = [&] {
      const ref::LaraMaps l = ref::lara_maps(maps, of.camera, given.alpha);
      return ref::weighed(l.image, image) + ref::weighed(maps.alpha, alpha) + ref::weighed(l.depth, depth) +
             ref::weighed(l.normal, normal) + ref::weighed(l.depth_normal, depth_normal);
    };
    std::vector<double> out;
    for (double& value : maps.*field) {
      // Where alpha is 0 nothing moves with what is drawn but alpha's own.
      const bool nothing = value == 0 && field == &ref::PictureMaps::alpha;
      out.push_back(nothing ? alpha[out.size()] : ref::derivative_by(value, 1e-6, loss));
    }
    return out;
  }
};

}  // namespace vsplat::selftest
