// Networks whose weights are on a device, shared by all of its streams.
#pragma once
#include <memory>
#include <mutex>
#include <vector>

#include "model/api/model.h"
#include "model/networks/network.h"
#include "runtime/context.h"

namespace vsplat::api {

// Thread-safe. A network stays until its model is freed, or until its memory is needed.
class Residents {
 public:
  // The model's network, uploaded and repacked with `ctx`, a context of the device, if it is not there yet; other
  // callers wait for that. If memory is short, drops the networks that no call uses.
  std::shared_ptr<const Network> network(Context& ctx, vsplat_model model);
  // Drops networks that no call uses, except the model's; returns whether there were any.
  bool drop_idle(vsplat_model but = nullptr);

 private:
  struct Resident {
    std::weak_ptr<const AnyModel> model;
    std::shared_ptr<const Network> network;
  };
  bool drop(const AnyModel* but);

  std::mutex mutex_;
  std::vector<Resident> all_;
};

}  // namespace vsplat::api
