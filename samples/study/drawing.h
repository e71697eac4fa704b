#pragma once

#include <string>
#include <vector>

/// A picture as a list of strokes, areas and words, written as SVG or painted as PNG: both from the same list.
namespace effuse::study {

/// Colours by what they are for; SVG in a page takes them from the page, so that dark mode can change them.
enum class Ink { kText, kFrame, kGrid, kReference, kCurve1, kCurve2, kCurve3, kCurve4, kCurve5, kCurve6, kWarning };
inline constexpr int kCurveInks = 6;
/// Ink of the k-th measured curve, k >= 0; from the start again after six.
Ink curve_ink(int k);

/// "#rrggbb" on a white or a dark page. The curves' are told apart by eyes that do not see red or green.
/// Source of the light ones: Okabe & Ito 2008, Color Universal Design.
std::string color_of(Ink ink, bool dark);

struct Position {
  double x = 0, y = 0;  ///< from the upper left, y down [px at scale 1]
};

struct Stroke {
  std::vector<Position> line;
  Ink ink = Ink::kText;
  double width = 1;           ///< 0: not stroked
  std::vector<double> dash;   ///< lengths on, off, on, ...; empty: solid
  bool closed = false, filled = false;
  bool clipped = false;       ///< to the drawing's clip rectangle
};

enum class Anchor { kStart, kMiddle, kEnd };

struct Words {
  std::string text;  ///< UTF-8
  Position at;       ///< of the baseline
  double size = 13;
  Anchor anchor = Anchor::kStart;
  bool upright = false;  ///< turned a quarter to the left: for the label of a y axis
  bool bold = false;
  Ink ink = Ink::kText;
};

struct Drawing {
  double width = 0, height = 0;
  Position clip_from, clip_to;
  std::string title;  ///< for readers that do not see
  std::vector<Stroke> strokes;
  std::vector<Words> words;
};

/// How wide text is [px], a little too much rather than too little: of DejaVu Sans, wider than what pages use.
double width_of(const std::string& text, double size);

/// A circle as a closed line.
std::vector<Position> circle(Position center, double radius);

/// An SVG file: white ground, fixed colours.
std::string svg_file(const Drawing& drawing);
/// An <svg> element for a page that has svg_style() in a <style>. id: letters, digits, _ and -; unique in the page.
std::string svg_element(const Drawing& drawing, const std::string& id);
/// CSS of the classes that svg_element uses; light and dark.
std::string svg_style();

/// The bytes of a PNG file, scale times as large, on white. Throws std::runtime_error when the painter fails.
std::string png_file(const Drawing& drawing, double scale = 2);

/// Text with & < > " ' as XML writes them, bytes that are not UTF-8 and control characters as U+FFFD.
std::string escaped(const std::string& text);

}  // namespace effuse::study
