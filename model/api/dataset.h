#pragma once
#include "model/api/handle.h"
#include "model/data/data_set.h"

struct vsplat_dataset_impl : vsplat::api::Counted {
  explicit vsplat_dataset_impl(vsplat::DataSet from) : data(std::move(from)) {}
  const vsplat::DataSet data;
};
