#include "model/ops/networks/plucker.h"

#include "model/diagnose/selftest/reference/plucker.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

class Plucker : public test::FlavourTest {};
VSPLAT_FLAVOURS(Plucker);
VSPLAT_OPERATION(Plucker, plucker)

TEST_P(Plucker, MatchesReference) {
  for (const auto& [views, tokens, patch] : {std::array<int, 3>{1, 1, 5}, {3, 7, 8}, {5, 9, 16}}) {
    const auto cameras = test::orbit(views, tokens * patch, 2.3);
    PluckerForward a;
    a.cameras = upload_cameras(ctx(), cameras);
    a.patch = patch;
    a.out =
        ctx().upload({views, tokens, tokens, 32}, test::nans(static_cast<std::size_t>(views * tokens * tokens * 32)));
    plucker_forward(ctx(), a);
    std::vector<double> want;
    for (const Camera& camera : cameras) {
      for (int y = 0; y < tokens; ++y) {
        for (int x = 0; x < tokens; ++x) {
          Eigen::Vector3d d, m;
          ref::plucker(camera, (x + 0.5) * patch, (y + 0.5) * patch, d, m);
          for (const double s : ref::real_sh3(d)) want.push_back(s);
          for (const double s : ref::real_sh3(m)) want.push_back(s);
        }
      }
    }
    EXPECT_TRUE(test::close(ctx().read<float>(a.out), want, 1e-6)) << views << " views, " << tokens << " tokens";
  }
}

TEST_P(Plucker, RejectsBadShape) {
  PluckerForward a;
  a.cameras = upload_cameras(ctx(), test::orbit(2, 16));
  a.patch = 8;
  a.out = ctx().tensor({3, 2, 2, 32});
  EXPECT_THROW(plucker_forward(ctx(), a), Error);
}

}  // namespace
}  // namespace vsplat
