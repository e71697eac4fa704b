#include "samples/study/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>

#include "geometry/base/check.h"
#include "geometry/base/types.h"

namespace effuse::study {

namespace {

constexpr double kWidth = 760, kPlotHeight = 400;  // of the whole picture, of the part between the axes
constexpr double kTitleSize = 15, kTitleRow = 20, kTextSize = 13, kTickSize = 12;
// How far beyond the reference a measured value is still shown in its place: in ranges of a reference that is a curve, in
// sizes of one that is a few points, and in decades of a logarithmic axis, which bears more. What is further blew up.
constexpr double kBeyondCurve = 2, kBeyondPoints = 100, kBeyondDecades = 8;
constexpr std::size_t kCurvePoints = 5;

double transformed(double value, bool log) { return log ? (value > 0 ? std::log10(value) : std::numeric_limits<double>::quiet_NaN()) : value; }

/// 10^n with the exponent as small raised digits.
std::string power_of_ten(int n) {
  static constexpr const char* kRaised[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = "10";
  for (const char c : std::to_string(n)) text += c == '-' ? "⁻" : kRaised[c - '0'];
  return text;
}

/// Ticks are multiples of a step, and their label has as many decimals as the step needs; very large and small ones
/// are a number times a power of ten.
std::string label_of(double value, double step, double largest) {
  if (value == 0) return "0";
  if (largest >= 1e5 || largest < 1e-3) {
    const int exponent = static_cast<int>(std::floor(std::log10(std::abs(value)) + 1e-9));
    const double factor = value / std::pow(10.0, exponent);
    const int decimals = std::clamp(static_cast<int>(exponent - std::floor(std::log10(step) + 1e-9)), 0, 6);
    const std::string head = fmt::format("{:.{}f}", std::abs(factor), decimals);
    return (value < 0 ? "−" : "") + (head == "1" ? "" : head + "·") + power_of_ten(exponent);
  }
  const int decimals = std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
  return fmt::format("{}{:.{}f}", value < 0 ? "−" : "", std::abs(value), decimals);
}

/// 1, 2 or 5 times a power of ten, at least `least`.
double nice_step(double least) {
  const double power = std::pow(10.0, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= least * (1 - 1e-9)) return factor * power;
  return 10 * power;
}

void add_linear_ticks(Axis& axis, int wanted) {
  const double step = nice_step((axis.last - axis.first) / wanted);
  const double largest = std::max(std::abs(axis.first), std::abs(axis.last)), slack = 1e-9 * (axis.last - axis.first);
  // Numbers that differ by less than rounding have no steps between them.
  if (!(step > 1e-14 * largest)) {
    axis.ticks.push_back({axis.first, fmt::format("{:g}", axis.first)});
    return;
  }
  const double before = std::ceil((axis.first - slack) / step);
  for (double k = before; k * step <= axis.last + slack; ++k) axis.ticks.push_back({k * step, label_of(k * step, step, largest)});
}

void add_log_ticks(Axis& axis, int wanted) {
  const int from = static_cast<int>(std::floor(std::log10(axis.first) - 1e-9)), to = static_cast<int>(std::ceil(std::log10(axis.last) + 1e-9));
  const int decades = to - from, every = std::max(1, (decades + wanted) / (wanted + 1));
  const auto inside = [&](double v) { return v >= axis.first * (1 - 1e-9) && v <= axis.last * (1 + 1e-9); };
  const bool few = std::log10(axis.last / axis.first) < 2, plain = axis.first > 0.9e-3 && axis.last < 0.99e5;
  const auto label_at = [&](int m, int e) {
    if (plain || (m == 1 && (e == 0 || e == 1))) return fmt::format("{:.{}f}", m * std::pow(10.0, e), std::max(0, -e));
    return m == 1 ? power_of_ten(e) : fmt::format("{}·{}", m, power_of_ten(e));
  };
  for (int e = from; e <= to; ++e) {
    const double power = std::pow(10.0, e);
    for (int m = 1; m <= 9; ++m) {
      if (!inside(m * power)) continue;
      const bool labelled = (m == 1 && (e - from) % every == 0) || (few && (m == 2 || m == 5));
      if (m == 1 || every == 1) axis.ticks.push_back({m * power, labelled ? label_at(m, e) : ""});
    }
  }
}

/// Smallest and largest of the values an axis can show.
struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double t) {
    if (!(std::abs(t) < 1e150)) return;  // differences stay finite; what is larger is off the axes
    low = std::min(low, t);
    high = std::max(high, t);
  }
  bool empty() const { return low > high; }
};

/// What the axis must show of the curves, x or y of each.
std::pair<double, double> extent(const Plot& plot, bool log, const std::vector<double> Curve::* values, bool limited) {
  Range reference, all;
  std::size_t references = 0;
  for (const Curve& curve : plot.curves)
    for (const double v : curve.*values) {
      all.add(transformed(v, log));
      if (!curve.reference) continue;
      reference.add(transformed(v, log));
      ++references;
    }
  if (all.empty()) return log ? std::pair(1.0, 10.0) : std::pair(0.0, 1.0);
  if (limited && !reference.empty()) {
    const double range = reference.high - reference.low, size = std::max(std::abs(reference.low), std::abs(reference.high));
    const double beyond = log ? std::max(kBeyondCurve * range, kBeyondDecades) : references >= kCurvePoints && range > 0 ? kBeyondCurve * range : kBeyondPoints * size;
    // A reference of 0 alone says nothing about what is too far from it.
    if (beyond > 0) {
      all = Range{};
      for (const Curve& curve : plot.curves)
        for (const double v : curve.*values) {
          const double t = transformed(v, log);
          if (t >= reference.low - beyond && t <= reference.high + beyond) all.add(t);
        }
    }
  }
  return log ? std::pair(std::pow(10.0, all.low), std::pow(10.0, all.high)) : std::pair(all.low, all.high);
}

/// Marks, told apart by shape as well as by colour.
Stroke mark(Position at, int k, Ink ink) {
  constexpr double r = 3.6;
  Stroke stroke{{}, ink, 1.4, {}, true, false, true};
  switch (k % 6) {
    case 0: stroke.line = circle(at, r); break;
    case 1: stroke.line = {{at.x - r, at.y - r}, {at.x + r, at.y - r}, {at.x + r, at.y + r}, {at.x - r, at.y + r}}; break;
    case 2: stroke.line = {{at.x, at.y - 1.2 * r}, {at.x + 1.1 * r, at.y + 0.8 * r}, {at.x - 1.1 * r, at.y + 0.8 * r}}; break;
    case 3: stroke.line = {{at.x, at.y - 1.3 * r}, {at.x + 1.3 * r, at.y}, {at.x, at.y + 1.3 * r}, {at.x - 1.3 * r, at.y}}; break;
    case 4: stroke.line = {{at.x, at.y + 1.2 * r}, {at.x + 1.1 * r, at.y - 0.8 * r}, {at.x - 1.1 * r, at.y - 0.8 * r}}; break;
    default: stroke.line = {{at.x - r, at.y}, {at.x + r, at.y}, at, {at.x, at.y - r}, {at.x, at.y + r}, at}; break;
  }
  return stroke;
}

std::vector<double> dash_of(int k) {
  static const std::vector<std::vector<double>> all = {{}, {7, 3}, {2, 3}, {9, 3, 2, 3}, {12, 4}, {5, 2, 1, 2, 1, 2}};
  return all[static_cast<std::size_t>(k) % all.size()];
}

/// How a curve is drawn. k counts the measured curves, or the references.
struct Style {
  Ink ink;
  double width;
  std::vector<double> dash;
  int k;
};
Style style_of(const Curve& curve, int k) {
  if (curve.reference) return {Ink::kReference, 1.6, dash_of(k), k};
  return {curve_ink(k), 2, dash_of(k), k};
}

/// The area between the axes, and the curves within it.
class Canvas {
 public:
  Canvas(Drawing& drawing, const Axis& x, const Axis& y) : drawing_(drawing), x_(x), y_(y) {}

  double across(double share) const { return drawing_.clip_from.x + share * (drawing_.clip_to.x - drawing_.clip_from.x); }
  double down(double share) const { return drawing_.clip_to.y - share * (drawing_.clip_to.y - drawing_.clip_from.y); }

  /// Draws a curve; returns how many of its points are at the border.
  std::size_t add(const Curve& curve, const Style& style) {
    std::size_t blown = 0;
    std::vector<Position> run;
    std::set<std::pair<int, int>> taken, crosses;  // half pixels that hold a mark: a million particles are no million marks
    const auto end_run = [&] {
      if (run.size() > 1) drawing_.strokes.push_back({run, style.ink, style.width, style.dash, false, false, true});
      if (run.size() == 1) drawing_.strokes.push_back({circle(run[0], style.width), style.ink, 0, {}, true, true, true});
      run.clear();
    };
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      const double sx = x_.share(curve.x[i]), sy = y_.share(curve.y[i]);
      constexpr double kSlack = 1e-9;
      const bool shown = sx >= -kSlack && sx <= 1 + kSlack && sy >= -kSlack && sy <= 1 + kSlack;
      if (!shown) {
        ++blown;
        // Not a number goes to the upper border: what explodes.
        const double low = y_.log && curve.y[i] <= 0 ? 0 : 1;
        const auto border = [](double share, double if_none) { return std::isnan(share) ? if_none : std::clamp(share, 0.0, 1.0); };
        cross({across(border(sx, x_.log && curve.x[i] <= 0 ? 0 : 1)), down(border(sy, low))}, style.ink, crosses);
        // A line leaves the frame towards such a point, and comes back from it, where it has a place.
        if (curve.points || !std::isfinite(sx) || !std::isfinite(sy)) end_run();
        else run.push_back({across(std::clamp(sx, -1.0, 2.0)), down(std::clamp(sy, -1.0, 2.0))});
        continue;
      }
      const Position at{across(sx), down(sy)};
      if (curve.points) {
        if (taken.insert(key(at, 0.5)).second) drawing_.strokes.push_back(mark(at, style.k, style.ink));
      } else if (run.empty() || std::hypot(at.x - run.back().x, at.y - run.back().y) > 0.2 || i + 1 == curve.x.size()) {
        run.push_back(at);
      }
    }
    end_run();
    return blown;
  }

 private:
  static std::pair<int, int> key(Position at, double cell) { return {static_cast<int>(std::lround(at.x / cell)), static_cast<int>(std::lround(at.y / cell))}; }
  void cross(Position at, Ink ink, std::set<std::pair<int, int>>& taken) {
    constexpr double r = 4;
    if (!taken.insert(key(at, 2.5 * r)).second) return;  // side by side, not one band
    drawing_.strokes.push_back({{{at.x - r, at.y - r}, {at.x + r, at.y + r}}, ink, 2, {}, false, false, false});
    drawing_.strokes.push_back({{{at.x - r, at.y + r}, {at.x + r, at.y - r}}, ink, 2, {}, false, false, false});
  }

  Drawing& drawing_;
  const Axis &x_, &y_;
};

/// Text cut at `width`, with an ellipsis.
std::string fitted(std::string text, double size, double width) {
  if (width_of(text, size) <= width) return text;
  while (!text.empty() && width_of(text + "…", size) > width) {
    text.pop_back();
    while (!text.empty() && (static_cast<std::uint8_t>(text.back()) & 0xc0) == 0x80) text.pop_back();
    if (!text.empty() && static_cast<std::uint8_t>(text.back()) >= 0xc0) text.pop_back();
  }
  return text + "…";
}

/// The title in one or two lines; what does not fit in two is cut.
std::vector<std::string> lines_of(const std::string& title, double width) {
  constexpr double kBold = 1.1;  // bold letters are wider
  if (width_of(title, kBold * kTitleSize) <= width) return {title};
  std::size_t at = std::string::npos;
  for (std::size_t space = title.find(' '); space != std::string::npos && width_of(title.substr(0, space), kBold * kTitleSize) <= width; space = title.find(' ', space + 1)) at = space;
  if (at == std::string::npos) return {fitted(title, kBold * kTitleSize, width)};
  return {title.substr(0, at), fitted(title.substr(at + 1), kBold * kTitleSize, width)};
}

/// Grid, ticks, frame and labels of the axes.
void add_axes(Drawing& drawing, const Canvas& canvas, const Axis& x, const Axis& y, const Plot& plot) {
  const double left = drawing.clip_from.x, right = drawing.clip_to.x, top = drawing.clip_from.y, bottom = drawing.clip_to.y;
  double last_label_end = -1e9;
  for (const Axis::Tick& tick : x.ticks) {
    const double at = canvas.across(x.share(tick.value)), half = width_of(tick.label, kTickSize) / 2;
    const bool labelled = !tick.label.empty() && at - half > last_label_end + 4;
    if (labelled) drawing.strokes.push_back({{{at, top}, {at, bottom}}, Ink::kGrid, 1, {}, false, false, false});
    drawing.strokes.push_back({{{at, bottom}, {at, bottom + (labelled ? 5.0 : 3.0)}}, Ink::kFrame, 1, {}, false, false, false});
    if (!labelled) continue;
    drawing.words.push_back({tick.label, {at, bottom + 19}, kTickSize, Anchor::kMiddle, false, false, Ink::kText});
    last_label_end = at + half;
  }
  double last_label_at = 1e9;
  for (const Axis::Tick& tick : y.ticks) {
    const double at = canvas.down(y.share(tick.value));
    const bool labelled = !tick.label.empty() && at < last_label_at - kTickSize;
    if (labelled) drawing.strokes.push_back({{{left, at}, {right, at}}, Ink::kGrid, 1, {}, false, false, false});
    drawing.strokes.push_back({{{left, at}, {left - (labelled ? 5.0 : 3.0), at}}, Ink::kFrame, 1, {}, false, false, false});
    if (!labelled) continue;
    drawing.words.push_back({tick.label, {left - 8, at + 0.35 * kTickSize}, kTickSize, Anchor::kEnd, false, false, Ink::kText});
    last_label_at = at;
  }
  drawing.strokes.push_back({{{left, top}, {right, top}, {right, bottom}, {left, bottom}}, Ink::kFrame, 1, {}, true, false, false});
  const std::vector<std::string> title = lines_of(plot.title, right - left);
  for (std::size_t k = 0; k < title.size(); ++k)
    drawing.words.push_back({title[k], {left, top - 14 - kTitleRow * static_cast<double>(title.size() - 1 - k)}, kTitleSize, Anchor::kStart, false, true, Ink::kText});
  drawing.words.push_back({plot.x_label, {(left + right) / 2, bottom + 40}, kTextSize, Anchor::kMiddle, false, false, Ink::kText});
  drawing.words.push_back({plot.y_label, {16, (top + bottom) / 2}, kTextSize, Anchor::kMiddle, true, false, Ink::kText});
}

}  // namespace

double Axis::share(double value) const {
  const double a = transformed(first, log), b = transformed(last, log);
  return (transformed(value, log) - a) / (b - a);
}

Axis make_axis(double low, double high, bool log, int wanted) {
  CHECK(std::isfinite(low) && std::isfinite(high) && low <= high);
  if (log) CHECK_GT(low, 0);
  double a = transformed(low, log), b = transformed(high, log);
  // Equal values stand in the middle of an axis.
  if (!(b - a > 1e-12 * std::max(std::abs(a), std::abs(b)))) {
    const double room = log ? 0.5 : a == 0 ? 1 : 0.1 * std::abs(a);
    a -= room;
    b += room;
  }
  // Room so that marks at the ends are whole; an axis of positive numbers that begins near zero begins at zero.
  const double room = 0.03 * (b - a);
  const bool at_zero = !log && low >= 0 && a < 0.2 * b;
  a = at_zero ? (low == 0 ? 0 : std::min(0.0, a)) : a - room;
  b += !log && high == 0 && low < 0 ? 0 : room;
  Axis axis;
  axis.log = log;
  axis.first = log ? std::pow(10.0, a) : a;
  axis.last = log ? std::pow(10.0, b) : b;
  if (log) add_log_ticks(axis, wanted);
  else add_linear_ticks(axis, wanted);
  // A logarithmic axis within one decade may hold no tick with a label, or one: it gets those of a linear one.
  const auto labelled = std::count_if(axis.ticks.begin(), axis.ticks.end(), [](const Axis::Tick& tick) { return !tick.label.empty(); });
  if (log && labelled < 2) {
    axis.ticks.clear();
    add_linear_ticks(axis, wanted - 2);
    std::erase_if(axis.ticks, [](const Axis::Tick& tick) { return tick.value <= 0; });
  }
  return axis;
}

Drawing draw(const Plot& plot) {
  for (const Curve& curve : plot.curves) CHECK_EQ(curve.x.size(), curve.y.size());
  const auto [x_low, x_high] = extent(plot, plot.log_x, &Curve::x, false);
  const auto [y_low, y_high] = extent(plot, plot.log_y, &Curve::y, true);
  const Axis x = make_axis(x_low, x_high, plot.log_x, 8), y = make_axis(y_low, y_high, plot.log_y, 6);

  Drawing drawing;
  drawing.width = kWidth;
  drawing.title = plot.title;
  double widest = 0;
  for (const Axis::Tick& tick : y.ticks) widest = std::max(widest, width_of(tick.label, kTickSize));
  const double left = std::ceil(34 + widest), right = kWidth - 24;
  const double top = 40 + kTitleRow * static_cast<double>(lines_of(plot.title, right - left).size() - 1);
  drawing.clip_from = {left, top};
  drawing.clip_to = {right, top + kPlotHeight};
  Canvas canvas(drawing, x, y);
  Plot fit = plot;  // labels that fit
  fit.x_label = fitted(plot.x_label, kTextSize, right - left);
  fit.y_label = fitted(plot.y_label, kTextSize, kPlotHeight);
  add_axes(drawing, canvas, x, y, fit);

  // References below all others, and first in the legend.
  std::vector<std::pair<const Curve*, Style>> order;
  int references = 0, measured = 0;
  for (const Curve& curve : plot.curves)
    if (curve.reference) order.emplace_back(&curve, style_of(curve, references++));
  for (const Curve& curve : plot.curves)
    if (!curve.reference) order.emplace_back(&curve, style_of(curve, measured++));
  std::size_t blown = 0;
  for (const auto& [curve, style] : order) blown += canvas.add(*curve, style);

  // The legend below the axes, where it covers nothing.
  constexpr double kSample = 30, kRow = 21;
  double at_x = left, at_y = drawing.clip_to.y + 66;
  for (const auto& [curve, style] : order) {
    const std::string name = fitted(curve->name, kTextSize, right - left - kSample - 8);
    const double width = kSample + 8 + width_of(name, kTextSize);
    if (at_x > left && at_x + width > right) {
      at_x = left;
      at_y += kRow;
    }
    const double middle = at_y - 0.35 * kTextSize;
    if (curve->points) {
      Stroke sample = mark({at_x + kSample / 2, middle}, style.k, style.ink);
      sample.clipped = false;
      drawing.strokes.push_back(sample);
    } else {
      drawing.strokes.push_back({{{at_x, middle}, {at_x + kSample, middle}}, style.ink, style.width, style.dash, false, false, false});
    }
    drawing.words.push_back({name, {at_x + kSample + 8, at_y}, kTextSize, Anchor::kStart, false, false, Ink::kText});
    at_x += width + 22;
  }
  if (blown > 0) {
    at_y += kRow;
    drawing.words.push_back({fmt::format("× at the border: {} {} not finite or off the axes", blown, blown == 1 ? "point" : "points"), {left, at_y}, kTextSize, Anchor::kStart, false, false, Ink::kWarning});
  }
  drawing.height = at_y + 14;
  return drawing;
}

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

std::string csv_number(double v) { return std::isnan(v) ? "nan" : fmt::format("{}", v); }

std::string csv_of(const Plot& plot) {
  std::string out;
  std::size_t rows = 0;
  for (const Curve& curve : plot.curves) {
    CHECK_EQ(curve.x.size(), curve.y.size());
    rows = std::max(rows, curve.x.size());
    out += fmt::format("{}{},{}", out.empty() ? "" : ",", csv_cell(curve.name + ": " + plot.x_label), csv_cell(curve.name + ": " + plot.y_label));
  }
  out += "\n";
  for (std::size_t i = 0; i < rows; ++i) {
    std::string row;
    for (const Curve& curve : plot.curves) {
      if (&curve != &plot.curves.front()) row += ",";
      row += i < curve.x.size() ? csv_number(curve.x[i]) + "," + csv_number(curve.y[i]) : ",";
    }
    out += row + "\n";
  }
  return out;
}

}  // namespace effuse::study
