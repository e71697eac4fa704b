#pragma once

#include <string>
#include <utility>
#include <vector>

#include "samples/study/drawing.h"
#include "samples/study/study.h"

/// Plots of a study: laid out once, for SVG, PNG and the page; and the same numbers as CSV.
namespace effuse::study {

/// Values of one axis and where they fall between 0 and 1.
struct Axis {
  double first = 0, last = 1;  ///< first < last; both > 0 when log
  bool log = false;
  struct Tick {
    double value = 0;
    std::string label;  ///< "": a small tick without one
  };
  std::vector<Tick> ticks;
  /// 0 at first, 1 at last, beyond outside; not a number for what the axis cannot show.
  double share(double value) const;
};

/// An axis over [low, high] with about `wanted` labelled ticks at 1, 2 or 5 times a power of ten; it ends at the data, not
/// at a tick, a little room aside. Any two finite numbers (both > 0 for log, checked), equal ones too.
Axis make_axis(double low, double high, bool log, int wanted = 6);

/// The reference first and in black, the measured curves in colours, dashes and marks of their own. Points that blew up
/// (not finite, not positive on a logarithmic axis, or further from the reference than twice its range or eight decades)
/// are crosses at the border, and a line below the plot says how many. Sizes of x and y agree (checked).
Drawing draw(const Plot& plot);

/// One row a point; two columns a curve, headed "NAME: X LABEL" and "NAME: Y LABEL"; cells after a curve's end are empty;
/// nan, inf and -inf as such; 17 digits where needed, so that reading gives the same numbers back.
std::string csv_of(const Plot& plot);

/// A CSV cell: quoted when it holds a comma, a quote or the end of a line.
std::string csv_cell(const std::string& text);
/// The shortest text that reads back as v.
std::string csv_number(double v);

}  // namespace effuse::study
