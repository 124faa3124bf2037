#include "settings.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>

#include "input_error.h"

namespace solidcull {
namespace {

/// Reads the values of one keyword, one after the other.
class Values {
 public:
  Values(const std::vector<std::string>& words, std::size_t keyword) : words_(words), keyword_(keyword), at_(keyword + 1) {}

  std::size_t end() const { return at_; }

  const std::string& word(const char* wanted) {
    if (at_ >= words_.size()) throw InputError("keyword '" + words_[keyword_] + "' ends too early: give " + wanted);
    return words_[at_++];
  }
  double number(const char* wanted, double least, bool least_allowed, double most = HUGE_VAL) {
    const std::string& w = word(wanted);
    char* rest = nullptr;
    const double v = std::strtod(w.c_str(), &rest);
    if (rest == w.c_str() || *rest != '\0' || !std::isfinite(v) || v < least || (v == least && !least_allowed) || v > most)
      refuse(w, wanted);
    return v;
  }
  int whole(const char* wanted, int least) {
    const std::string& w = word(wanted);
    char* rest = nullptr;
    const long v = std::strtol(w.c_str(), &rest, 10);
    if (rest == w.c_str() || *rest != '\0' || v < least || v > 2000000000L) refuse(w, wanted);
    return static_cast<int>(v);
  }
  void one_of(const char* wanted, const std::map<std::string, std::function<void()>>& choices) {
    const std::string& w = word(wanted);
    const auto choice = choices.find(w);
    if (choice == choices.end()) refuse(w, wanted);
    choice->second();
  }
  /// Takes the next word if it is this one.
  bool takes(const char* word) {
    if (at_ >= words_.size() || words_[at_] != word) return false;
    ++at_;
    return true;
  }
  /// Ends with one of these. With '%' each rank writes a file of its own, which some kinds of files have no need of.
  std::string file(const std::vector<std::string>& endings, const char* wanted) {
    const std::string& w = word(wanted);
    for (const std::string& e : endings)
      if (w.size() > e.size() && w.compare(w.size() - e.size(), e.size(), e) == 0) {
        if (e != ".vdb" && w.find('%') != std::string::npos) refuse(w, "a name without '%': all ranks write one " + e);
        return w;
      }
    refuse(w, wanted);
    return {};
  }

 private:
  void refuse(const std::string& value, const std::string& wanted) const {
    throw InputError("keyword '" + words_[keyword_] + "' has the value '" + value + "': give " + wanted);
  }

  const std::vector<std::string>& words_;
  std::size_t keyword_, at_;
};

using Reader = std::function<void(Values&, Settings&)>;

const std::map<std::string, Reader>& readers() {
  static const std::map<std::string, Reader> table = {
      {"every", [](Values& v, Settings& s) { s.every = v.whole("a whole number of steps, 1 or more", 1); }},
      {"depth", [](Values& v, Settings& s) { s.depth = v.number("a number of mean diameters, 0 to 50", 0, true, 50); }},
      {"exterior",
       [](Values& v, Settings& s) {
         v.one_of("'live' or 'sleep'",
                  {{"live", [&] { s.exterior = Exterior::live; }}, {"sleep", [&] { s.exterior = Exterior::sleep; }}});
       }},
      {"speed", [](Values& v, Settings& s) { s.speed = v.number("a fraction of sqrt(g d), more than 0", 0, false); }},
      {"calm", [](Values& v, Settings& s) { s.calm = v.whole("a whole number of looks, 1 or more", 1); }},
      {"tolerance",
       [](Values& v, Settings& s) {
         const char* wanted = "two numbers A R, 0 or more and not both 0";
         s.tolerance_absolute = v.number(wanted, 0, true);
         s.tolerance_relative = v.number(wanted, 0, true);
         if (s.tolerance_absolute == 0 && s.tolerance_relative == 0)
           throw InputError(std::string("keyword 'tolerance' has the value '0 0': give ") + wanted);
       }},
      {"carve",
       [](Values& v, Settings& s) {
         const char* wanted = "two numbers C CAP: radius in mean diameters, more than 0; growth, 1 or more";
         s.carve_radius = v.number(wanted, 0, false);
         s.carve_cap = v.number(wanted, 1, true);
       }},
      {"store",
       [](Values& v, Settings& s) {
         v.one_of("'exact', 'compact' or 'none'", {{"exact", [&] { s.store = Store::exact; }},
                                                   {"compact", [&] { s.store = Store::compact; }},
                                                   {"none", [&] { s.store = Store::none; }}});
       }},
      {"restore",
       [](Values& v, Settings& s) {
         v.one_of("'exact' or 'refill'",
                  {{"exact", [&] { s.restore = Restore::exact; }}, {"refill", [&] { s.restore = Restore::refill; }}});
       }},
      {"voxel", [](Values& v, Settings& s) { s.voxel = v.number("a size in mean diameters, 0.1 to 2", 0.1, true, 2.0); }},
      {"balance",
       [](Values& v, Settings& s) {
         const char* wanted = "a whole number of steps, 1 or more, and the largest work of a rank over the mean, more than 1";
         s.balance_every = v.whole(wanted, 1);
         s.balance_threshold = v.number(wanted, 1, false);
       }},
      {"audit",
       [](Values& v, Settings& s) {
         const char* wanted = "two whole numbers N K: steps from one audit to the next, patches that each wakes";
         s.audit_every = v.whole(wanted, 1);
         s.audit_patches = v.whole(wanted, 1);
       }},
      {"report",
       [](Values& v, Settings& s) {
         v.one_of("'short' or 'full'",
                  {{"short", [&] { s.report = ReportLength::brief; }}, {"full", [&] { s.report = ReportLength::full; }}});
       }},
      {"reasons",
       [](Values& v, Settings& s) {
         v.one_of("'yes' or 'no'", {{"yes", [&] { s.reasons = true; }}, {"no", [&] { s.reasons = false; }}});
       }},
      {"mesh",
       [](Values& v, Settings& s) {
         MeshOutput o;
         o.every = v.whole("a whole number of steps, 1 or more, and a file name", 1);
         o.file = v.file({".vdb", ".stl", ".vtp"}, "a file name that ends with .vdb, .stl or .vtp");
         for (;;)
           if (v.takes("surface"))
             o.surface = true;
           else if (v.takes("skin"))
             o.skin = true;
           else if (v.takes("least"))
             o.least = v.whole("a whole number of granules, 1 or more, behind 'least'", 1);
           else
             break;
         s.meshes.push_back(o);
       }},
      {"bed",
       [](Values& v, Settings& s) {
         BedOutput o;
         o.every = v.whole("a whole number of steps, 1 or more, and a file name", 1);
         o.file = v.file({".vtp", ".vdb"}, "a file name that ends with .vtp or .vdb");
         for (;;)
           if (v.takes("seen"))
             o.seen = true;
           else if (v.takes("spin"))
             o.spin = true;
           else
             break;
         s.beds.push_back(o);
       }},
  };
  return table;
}

/// What may stand behind the file of a keyword.
const std::map<std::string, std::string>& words_behind_a_file() {
  static const std::map<std::string, std::string> table = {{"mesh", "'surface', 'skin' or 'least K'"},
                                                           {"bed", "'seen' or 'spin'"}};
  return table;
}

/// Keywords of 0.1, and what to do without them.
const std::map<std::string, std::string>& gone() {
  static const std::map<std::string, std::string> table = {
      {"motion", "bodies that walls hold stand still by themselves"},
      {"walls", "walls that stand still always count as cover"},
  };
  return table;
}

}  // namespace

std::vector<std::string> setting_keywords() {
  std::vector<std::string> names;
  for (const auto& r : readers()) names.push_back(r.first);
  return names;
}

Settings parse_settings(const std::vector<std::string>& words) {
  Settings s;
  s.depth = -1;
  std::string before;
  for (std::size_t at = 0; at < words.size();) {
    const auto reader = readers().find(words[at]);
    if (const auto old = gone().find(words[at]); old != gone().end())
      throw InputError("keyword '" + words[at] + "' is no more: leave it and its value out; " + old->second);
    if (reader == readers().end()) {
      std::string known;
      for (const std::string& k : setting_keywords()) known += (known.empty() ? "" : ", ") + k;
      const auto behind = words_behind_a_file().find(before);
      if (behind != words_behind_a_file().end()) known += "; behind the file of '" + before + "' may stand " + behind->second;
      throw InputError("unknown keyword '" + words[at] + "': choose from " + known);
    }
    Values values(words, at);
    reader->second(values, s);
    before = words[at];
    at = values.end();
  }
  if (s.depth < 0) s.depth = s.exterior == Exterior::live ? 2.0 : 0.0;
  if (s.store == Store::none && s.restore != Restore::refill)
    throw InputError(
        "keyword 'store' has the value 'none' and 'restore' the value 'exact': say 'restore refill', or store granules");
  if (s.store != Store::none && s.restore == Restore::refill)
    throw InputError("keyword 'restore' has the value 'refill' and 'store' keeps granules: say 'store none', or 'restore exact'");
  if (s.exterior == Exterior::live && s.depth == 0)
    throw InputError(
        "keyword 'depth' has the value '0' and 'exterior' the value 'live': give a cover of more than 0, or say "
        "'exterior sleep'");
  if (s.exterior == Exterior::live && 2 * s.voxel > s.depth) {
    const auto text = [](double x) {
      std::string t = std::to_string(x);
      return t.substr(0, t.find_last_not_of('0') + 1 + (t.find('.') == t.find_last_not_of('0') ? 1 : 0));
    };
    throw InputError("voxel " + text(s.voxel) + " is too coarse for depth " + text(s.depth) + ": choose voxel <= depth/2");
  }
  return s;
}

int look_interval(double mean_diameter, double gravity, double dt) {
  const double steps = 0.05 * std::sqrt(mean_diameter / gravity) / dt;
  return static_cast<int>(std::clamp(std::round(steps), 10.0, 1000.0));
}

}  // namespace solidcull
