#include "model/train/train_ranks.h"

#include <fmt/format.h>

#include <memory>
#include <optional>

#include "model/networks/params/params.h"
#include "model/train/training_reading.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

enum class Word : int { begin, step, moved, rest, end };

void broadcast(Ranks& ranks, MessageOut message) { ranks.broadcast(message.bytes()); }

// This rank's share of a training.
struct Following {
  Following(Context& ctx, const Checkpoint& start, const DataSet& data, const TrainOptions& options, Ranks& ranks)
      : selection(forced_selection(start.config, options.selection)),
        trainer(ctx, start, planned_of(selection, options.planned_selected), options.helpers, &ranks) {
    TrainingOptions own = training_reading(start.config, options);
    const auto [first, last] = trainer.own_objects();
    own.first_item = static_cast<int>(first), own.last_item = static_cast<int>(last);
    reader.emplace(data, own);
  }

  // Computes this rank's shards of the next step. Unreadable data are reported to rank 0 as an error.
  void help(Ranks& ranks) {
    const auto [first, last] = trainer.own_objects();
    std::vector<TrainingViews> views;
    std::vector<StepItem> items(static_cast<std::size_t>(trainer.config().batch * trainer.config().accumulate));
    try {
      for (std::size_t i = first; i < last; ++i) views.push_back(reader->at(trainer.step(), static_cast<int>(i)));
    } catch (const Error& e) {
      MessageOut out;
      ranks.send(0, out.add(e.status()).add(std::string(e.what())).bytes());
      return;
    }
    for (std::size_t i = first; i < last; ++i) {
      items[i].views = &views[i - first];
      if (selection) items[i].selection = &*selection;
    }
    trainer.help(items);
  }

  std::optional<std::vector<int>> selection;
  Trainer trainer;
  std::optional<TrainingReader> reader;
};

}  // namespace

RankLeader::~RankLeader() {
  try {
    MessageOut out;
    broadcast(ranks_, out.add(Word::end));
  } catch (const Error&) {  // the other ranks are gone; the call that failed first has reported it
  }
}

void RankLeader::begin(const Checkpoint& start) {
  if (start.config.parts < ranks_.count())
    fail(Status::usage,
         "{} processes share the parts of a step, but the configuration's parts is {}: {} or more, at most {} (batch x "
         "accumulate) expected",
         ranks_.count(), start.config.parts, ranks_.count(), start.config.batch * start.config.accumulate);
  MessageOut out;
  out.add(Word::begin).add(to_json(start.config)).add(static_cast<std::int64_t>(start.step));
  out.add(static_cast<std::uint64_t>(start.state.size()));
  for (const auto& [name, text] : start.state) out.add(name).add(text);
  for (const Parameter& p : parameters(start.config.model)) out.add(start.parameters.of(p).data);
  broadcast(ranks_, std::move(out));
  std::string problem;
  Status status = Status::ok;
  for (int rank = 1; rank < ranks_.count(); ++rank) {
    MessageIn answer(ranks_.receive(rank));
    const auto of_rank = answer.take<Status>();
    const std::string text = answer.take_text();
    if (of_rank != Status::ok && status == Status::ok)
      status = of_rank, problem = fmt::format("rank {}: {}", rank, text);
  }
  if (status != Status::ok) throw Error(status, problem);
}

void RankLeader::begin_step() {
  MessageOut out;
  broadcast(ranks_, out.add(Word::step));
}

void RankLeader::give_moved(const std::vector<float>& weights, const std::string& kinds) {
  MessageOut out;
  broadcast(ranks_, out.add(Word::moved).add(weights).add(kinds));
}

void RankLeader::rest() {
  MessageOut out;
  broadcast(ranks_, out.add(Word::rest));
}

void follow(Context& ctx, const DataSet& data, const std::function<TrainOptions(const TrainConfig&)>& options,
            Ranks& ranks) {
  std::unique_ptr<Following> now;
  for (;;) {
    Ranks::Bytes bytes;
    ranks.broadcast(bytes);
    MessageIn message(std::move(bytes));
    switch (message.take<Word>()) {
      case Word::begin: {
        Checkpoint start;
        start.config = train_config_from_json(message.take_text());
        start.step = static_cast<long>(message.take<std::int64_t>());
        for (auto left = message.take<std::uint64_t>(); left > 0; --left) {
          const std::string name = message.take_text();
          start.state[name] = message.take_text();
        }
        for (const Parameter& p : parameters(start.config.model))
          start.parameters.set(p.name, {p.shape, message.take_floats()});
        MessageOut answer;
        try {
          now = std::make_unique<Following>(ctx, start, data, options(start.config), ranks);
          answer.add(Status::ok).add(std::string());
        } catch (const Error& e) {
          answer.add(e.status()).add(std::string(e.what()));
        }
        ranks.send(0, answer.bytes());
        break;
      }
      case Word::step:
        now->help(ranks);
        break;
      case Word::moved: {
        std::vector<float> values = message.take_floats();
        now->trainer.take_moved(std::move(values), message.take_text());
        break;
      }
      case Word::rest:
        now.reset();
        ctx.memory().trim();
        break;
      case Word::end:
        return;
    }
  }
}

}  // namespace vsplat
