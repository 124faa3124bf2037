#include "run_summary.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <iterator>
#include <vector>

namespace solidcull {
namespace {

// what keeps less than this share of the exterior granules awake is not told
constexpr double worth_telling = 0.1;
constexpr std::size_t most_reasons = 2;
// a keyword limits where this share of them would be calm, or would not have woken, with another value of it
constexpr double limits = 1.0 / 3;
constexpr double most_of_what_woke = 2.0 / 3;
// so few are exterior that advice is none, or the run too short for one
constexpr double worth_advice = 0.02, steps_for_advice = 100;
constexpr double about_as_long = 0.05;

std::string format(const char* how, ...) __attribute__((format(printf, 1, 2)));
std::string format(const char* how, ...) {
  char text[256];
  std::va_list values;
  va_start(values, how);
  std::vsnprintf(text, sizeof text, how, values);
  va_end(values);
  return text;
}

const char* words_for(Awake why) {
  switch (why) {
    case Awake::held:
      return "held by the deck, or not of the group";
    case Awake::alone:
      return "touch nothing";
    case Awake::moving:
      return "move faster than 'speed'";
    case Awake::unsteady:
      return "out of balance";
    case Awake::settling:
      return "calm, but not for long enough";
    case Awake::covered:
      return "within 'depth'";
    case Awake::paused:
      return "culling pauses";
    case Awake::count:
      break;
  }
  return "";
}

const char* words_for(Woke by) {
  switch (by) {
    case Woke::load:
      return "loads that changed";
    case Woke::shaken:
      return "their body was shaken";
    case Woke::exposed:
      return "exposed";
    case Woke::wall:
      return "a wall has gone";
    case Woke::insertion:
      return "new granules in their place";
    case Woke::deck:
      return "the deck, or a program";
    case Woke::no_gain:
      return "culling did not pay";
    case Woke::lost:
      return "parts of clumps that were lost";
    case Woke::audit:
      return "audits";
    case Woke::never:
    case Woke::count:
      break;
  }
  return "";
}

/// The main reasons, the first one first.
template <class Reason>
std::string reasons(const ByReason<Reason>& numbers) {
  std::vector<Reason> by_size;
  for (int k = 0; k < static_cast<int>(Reason::count); ++k) by_size.push_back(static_cast<Reason>(k));
  std::stable_sort(by_size.begin(), by_size.end(), [&](Reason a, Reason b) { return numbers[a] > numbers[b]; });
  std::string said;
  for (std::size_t k = 0; k < most_reasons; ++k) {
    const double share = numbers[by_size[k]] / numbers.all();
    if (share >= worth_telling) said += format("%s%s %.0f %%", said.empty() ? "" : ", ", words_for(by_size[k]), 100 * share);
  }
  return said;
}

std::string compared(double times) {
  if (times > 1 + about_as_long) return format("about %.2g times less work than without it", times);
  if (times < 1 - about_as_long) return format("about %.2g times more work than without it", 1 / times);
  return "about as much work as without it";
}

}  // namespace

std::string text_of(const RunSummary& run, const Settings& settings) {
  const RunWork& w = run.work;
  const double all = w.all();
  std::string text = format("%.0f steps, %.0f granules", w.steps, w.mean(all));
  const auto line = [&](const char* name, const std::string& what) { text += format("\n  %-13s = ", name) + what; };
  const auto share = [&](double part) { return format("%.0f (%.1f %%)", w.mean(part), 100 * part / all); };
  line("exterior", share(w.exterior) + " on average");
  if (w.interface + w.interior > 0) {
    line("interface", share(w.interface));
    line("left out", share(w.interior));
  }
  line("granule-steps", format("%.3g computed, %.3g saved", w.computed(), w.interior));
  line("time", format("%.3g s, of it %.3g s in the fix", w.seconds, w.in_fix) +
                   (run.seconds_without > 0 ? ": " + compared(run.seconds_without / w.seconds) : ""));
  if (run.runs > 1 && run.seconds_without > 0) line("all runs", compared(run.times_less));
  const std::string awake = w.awake.all() > 0 ? reasons(w.awake) : "";
  if (!awake.empty()) line("kept awake", awake);
  if (w.woken.all() > 0) line("woken by", reasons(w.woken) + format(", of %.0f", w.woken.all()));
  const std::string advice = advice_on(w, settings);
  if (!advice.empty()) line("advice", advice);
  if (!run.audit.empty()) line("audit", run.audit);
  return text;
}

std::string text_of(const Forecast& f, const RunWork& lately, const Settings& settings) {
  std::string text = "if it goes on like this, the run will be " + compared(f.times_less) +
                     format(": %.2g %% of the granules are exterior, %.2g %% move", 100 * f.awake, 100 * f.moving);
  const std::string advice = advice_on(lately, settings);
  return advice.empty() ? text : text + "; " + advice;
}

std::string advice_on(const RunWork& w, const Settings& settings) {
  const double awake = w.awake.all();
  if (w.steps < steps_for_advice || w.exterior < worth_advice * w.all() || awake == 0) return "";
  struct Limit {
    double steps;  // of granules that it keeps awake
    std::string keyword;
    const char* why;
  };
  const bool live = settings.exterior == Exterior::live;
  const std::string tolerance =
      format("a larger 'tolerance' than %g %g", settings.tolerance_absolute, settings.tolerance_relative);
  // below a live surface what is exposed wakes, too
  const bool woke_in_vain = !live && w.in_vain >= most_of_what_woke * w.restored;
  const Limit all[] = {
      {woke_in_vain ? w.awake.in_vain : 0, tolerance, "woke and has not moved"},
      {w.awake.nearly_balanced, tolerance, "is out of balance by less than twice what it allows"},
      {w.awake.nearly_slow, format("a larger 'speed' than %g", settings.speed), "moves less than twice as fast"},
      {w.awake[Awake::covered], live ? "'exterior sleep'" : format("a smaller 'depth' than %g", settings.depth),
       live ? "rests, but near the surface" : "rests, but near what does not"},
  };
  const Limit* most =
      std::max_element(std::begin(all), std::end(all), [](const Limit& a, const Limit& b) { return a.steps < b.steps; });
  if (most->steps < limits * awake) return "";
  return most->keyword + " lets more sleep: " + format("%.0f %% of what is awake ", 100 * most->steps / awake) + most->why +
         "; twin.py shows the error";
}

}  // namespace solidcull
