#include "runtime/share_out.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

#include "runtime/fail.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

void wait_ms(int ms) { std::this_thread::sleep_for(std::chrono::milliseconds(ms)); }

// How often each item was done and by which worker, and the order of the reports.
struct Record {
  explicit Record(std::size_t items) : times(items), by(items) {}

  std::vector<std::atomic<int>> times;
  std::vector<std::atomic<std::size_t>> by;
  std::vector<std::size_t> delivered;

  void note(std::size_t worker, std::size_t item) {
    ++times[item];
    by[item] = worker;
  }
  void expect_all_once_in_order() const {
    ASSERT_EQ(delivered.size(), times.size());
    for (std::size_t i = 0; i < times.size(); ++i) {
      EXPECT_EQ(times[i], 1) << i;
      EXPECT_EQ(delivered[i], i);
    }
  }
};

TEST(ShareOut, EachItemOnceAndToldInOrder) {
  for (const std::size_t items : {0, 1, 2, 7, 64})
    for (const std::size_t workers : {1, 2, 3, 8}) {
      Record record(items);
      share_out({.items = items,
                 .workers = workers,
                 .work =
                     [&](std::size_t worker, std::size_t item) {
                       EXPECT_LT(worker, workers);
                       if (item % 3 == 0) wait_ms(1);  // so that later items end first
                       record.note(worker, item);
                     },
                 .done = [&](std::size_t item) { record.delivered.push_back(item); }});
      record.expect_all_once_in_order();
    }
}

TEST(ShareOut, OneWorkerIsTheCallingThread) {
  const std::thread::id here = std::this_thread::get_id();
  share_out({.items = 3, .work = [&](std::size_t, std::size_t) { EXPECT_EQ(std::this_thread::get_id(), here); }});
}

TEST(ShareOut, TheFasterOneDoesMore) {
  Record record(40);
  share_out({.items = 40, .workers = 2, .ahead = 40, .work = [&](std::size_t worker, std::size_t item) {
               wait_ms(worker == 0 ? 20 : 2);
               record.note(worker, item);
             }});
  const auto slow = std::count_if(record.by.begin(), record.by.end(), [](const auto& by) { return by == 0; });
  EXPECT_GE(slow, 1);
  EXPECT_LE(slow, 13);
}

TEST(ShareOut, NoneRunsFurtherAheadThanAllowed) {
  std::atomic<std::size_t> delivered{0}, furthest{0};
  share_out({.items = 50,
             .workers = 3,
             .ahead = 5,
             .work =
                 [&](std::size_t, std::size_t item) {
                   const std::size_t lead = item - std::min(item, delivered.load());
                   std::size_t before = furthest;
                   while (lead > before && !furthest.compare_exchange_weak(before, lead)) {
                   }
                   if (item == 10) wait_ms(30);
                 },
             .done = [&](std::size_t item) { delivered = item + 1; }});
  // (`delivered` is set just before the next item may begin, so the lead is at most that.)
  EXPECT_LE(furthest, 5u);
  EXPECT_GE(furthest, 3u);
}

TEST(ShareOut, WithoutABound) {
  Record record(9);
  share_out({.items = 9,
             .workers = 2,
             .ahead = static_cast<std::size_t>(-1),
             .work = [&](std::size_t worker, std::size_t item) { record.note(worker, item); },
             .done = [&](std::size_t item) { record.delivered.push_back(item); }});
  record.expect_all_once_in_order();
}

TEST(ShareOut, OthersDoTheWorkOfALostDevice) {
  for (const Status status : {Status::device, Status::memory}) {
    Record record(20);
    std::vector<std::size_t> lost;
    share_out({.items = 20,
               .workers = 3,
               .work =
                   [&](std::size_t worker, std::size_t item) {
                     wait_ms(1);
                     if (worker == 1 && item >= 4) fail(status, "gone at {}", item);
                     record.note(worker, item);
                   },
               .done = [&](std::size_t item) { record.delivered.push_back(item); },
               .lost =
                   [&](std::size_t worker, std::size_t item, const Error& error) {
                     EXPECT_EQ(worker, 1u);
                     EXPECT_EQ(std::string(error.what()), "gone at " + std::to_string(item));
                     lost.push_back(item);
                   }});
    record.expect_all_once_in_order();
    EXPECT_EQ(lost.size(), 1u);
  }
}

TEST(ShareOut, ALostDeviceHoldsNobodyUp) {  // the others wait for its item, which one of them must do
  Record record(30);
  share_out({.items = 30,
             .workers = 3,
             .work =
                 [&](std::size_t worker, std::size_t item) {
                   if (item == 2 && worker != 0) {  // the first unfinished item, once the others can do nothing else
                     wait_ms(20);
                     if (record.times[2].fetch_add(1) == 0) fail(Status::device, "gone");
                     record.times[2] = 0;
                   }
                   record.note(worker, item);
                 },
             .done = [&](std::size_t item) { record.delivered.push_back(item); }});
  ASSERT_EQ(record.delivered.size(), 30u);
}

TEST(ShareOut, OwnersDoWhatIsTheirs) {
  const std::vector<std::size_t> owner{0, 0, 2, 2, 1, 0, 2};
  for (const bool gone : {false, true}) {
    Record record(owner.size());
    share_out({.items = owner.size(),
               .workers = 3,
               .owner = owner,
               .work =
                   [&](std::size_t worker, std::size_t item) {
                     if (gone && worker == 2) fail(Status::device, "gone");
                     wait_ms(worker == 0 ? 5 : 1);
                     record.note(worker, item);
                   },
               .done = [&](std::size_t item) { record.delivered.push_back(item); }});
    record.expect_all_once_in_order();
    for (std::size_t i = 0; i < owner.size(); ++i) {
      if (gone && owner[i] == 2)
        EXPECT_NE(record.by[i], 2u) << i;
      else
        EXPECT_EQ(record.by[i], owner[i]) << i;
    }
  }
}

TEST(ShareOut, WithNoDeviceLeftItIsAnError) {
  std::atomic<int> lost{0};
  test::expect_error(Status::device, {}, [&] {
    share_out({.items = 9,
               .workers = 3,
               .work = [](std::size_t, std::size_t item) { fail(Status::device, "gone at {}", item); },
               .lost = [&](std::size_t, std::size_t, const Error&) { ++lost; }});
  });
  EXPECT_EQ(lost, 2);
}

TEST(ShareOut, AnErrorEndsItAndTheFirstItemsIsReported) {
  for (const std::size_t workers : {1, 2, 4}) {
    std::vector<std::size_t> delivered;
    std::atomic<std::size_t> begun{0};
    try {
      share_out({.items = 100,
                 .workers = workers,
                 .work =
                     [&](std::size_t, std::size_t item) {
                       ++begun;
                       if (item == 5) wait_ms(10);  // a later item fails first
                       if (item >= 5) fail(Status::input, "item {}", item);
                     },
                 .done = [&](std::size_t item) { delivered.push_back(item); }});
      FAIL() << "no error";
    } catch (const Error& e) {
      EXPECT_EQ(std::string(e.what()), "item 5");
    }
    EXPECT_LE(begun, 5 + 2 * workers);
    EXPECT_EQ(delivered, (std::vector<std::size_t>{0, 1, 2, 3, 4}));
  }
}

TEST(ShareOut, WhatIsThrownWhileReportingEndsIt) {
  std::atomic<std::size_t> begun{0}, delivered{0};
  EXPECT_THROW(share_out({.items = 100,
                          .workers = 2,
                          .work = [&](std::size_t, std::size_t) { ++begun; },
                          .done =
                              [&](std::size_t item) {
                                ++delivered;
                                if (item == 3) throw std::runtime_error("full disk");
                              }}),
               std::runtime_error);
  EXPECT_LE(begun, 10u);
  EXPECT_EQ(delivered, 4u);
}

}  // namespace
}  // namespace vsplat
