#include "samples/study/drawing.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string_view>

#include "geometry/base/check.h"
#include "geometry/base/types.h"

#ifdef __SANITIZE_ADDRESS__
// Fontconfig, which Cairo asks for fonts, keeps its configuration to the end of the process and frees it nowhere.
extern "C" const char* __lsan_default_suppressions() { return "leak:libfontconfig"; }
extern "C" const char* __lsan_default_options() { return "print_suppressions=0"; }
#endif

namespace effuse::study {

namespace {

struct InkRow {
  Ink ink;
  const char* css;  ///< class in SVG
  std::uint32_t light, dark;
};
constexpr std::array<InkRow, 11> kInks = {{
    {Ink::kText, "i-text", 0x202020, 0xe6e6e6},
    {Ink::kFrame, "i-frame", 0x606060, 0xa0a0a0},
    {Ink::kGrid, "i-grid", 0xe2e2e2, 0x383838},
    {Ink::kReference, "i-reference", 0x000000, 0xffffff},
    {Ink::kCurve1, "i-curve1", 0x0072b2, 0x5ab4f0},
    {Ink::kCurve2, "i-curve2", 0xd55e00, 0xff8c42},
    {Ink::kCurve3, "i-curve3", 0x009e73, 0x3ecfa3},
    {Ink::kCurve4, "i-curve4", 0xcc79a7, 0xe8a6ca},
    {Ink::kCurve5, "i-curve5", 0xb07d00, 0xf0c24a},
    {Ink::kCurve6, "i-curve6", 0x56b4e9, 0x9ad7ff},
    {Ink::kWarning, "i-warning", 0xb00020, 0xff7a85},
}};

const InkRow& row_of(Ink ink) {
  const auto found = std::find_if(kInks.begin(), kInks.end(), [&](const InkRow& row) { return row.ink == ink; });
  CHECK(found != kInks.end());
  return *found;
}

constexpr const char* kFont = "DejaVu Sans";
constexpr const char* kFontList = "'DejaVu Sans',Verdana,system-ui,sans-serif";

/// The code point that begins at text[at] and how many bytes it takes; U+FFFD and 1 where text is not UTF-8.
std::pair<char32_t, std::size_t> code_point(std::string_view text, std::size_t at) {
  constexpr char32_t kBroken = 0xfffd;
  const auto byte = [&](std::size_t k) { return static_cast<std::uint8_t>(text[k]); };
  const std::uint8_t lead = byte(at);
  if (lead < 0x80) return {lead, 1};
  const std::size_t length = lead >= 0xc2 && lead < 0xe0 ? 2 : lead >= 0xe0 && lead < 0xf0 ? 3 : lead >= 0xf0 && lead < 0xf5 ? 4 : 0;
  if (length == 0 || at + length > text.size()) return {kBroken, 1};
  char32_t code = lead & (0xff >> (length + 1));
  for (std::size_t k = 1; k < length; ++k) {
    if ((byte(at + k) & 0xc0) != 0x80) return {kBroken, 1};
    code = code << 6 | (byte(at + k) & 0x3f);
  }
  const bool overlong = (length == 3 && code < 0x800) || (length == 4 && code < 0x10000);
  if (overlong || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return {kBroken, 1};
  return {code, length};
}

std::string number(double v) {
  std::string text = fmt::format("{:.2f}", v);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

std::string path_of(const Stroke& stroke) {
  std::string d;
  for (std::size_t i = 0; i < stroke.line.size(); ++i) d += fmt::format("{}{} {}", i == 0 ? "M" : "L", number(stroke.line[i].x), number(stroke.line[i].y));
  return stroke.closed ? d + "Z" : d;
}

/// What is between <svg> and </svg>.
std::string svg_body(const Drawing& drawing, const std::string& id) {
  std::string out = fmt::format("<title>{}</title>\n<clipPath id=\"{}-clip\"><path d=\"M{} {}H{}V{}H{}Z\"/></clipPath>\n", escaped(drawing.title), id, number(drawing.clip_from.x),
                                number(drawing.clip_from.y), number(drawing.clip_to.x), number(drawing.clip_to.y), number(drawing.clip_from.x));
  for (const Stroke& stroke : drawing.strokes) {
    if (stroke.line.empty()) continue;
    const char* css = row_of(stroke.ink).css;
    std::string classes = stroke.width > 0 ? fmt::format("{} s", css) : "";
    if (stroke.filled) classes = fmt::format("{}{}f", classes, classes.empty() ? std::string(css) + " " : " ");
    out += fmt::format("<path class=\"{}\" d=\"{}\"", classes, path_of(stroke));
    if (stroke.width > 0 && stroke.width != 1) out += fmt::format(" stroke-width=\"{}\"", number(stroke.width));
    if (!stroke.dash.empty()) {
      std::string dash;
      for (const double length : stroke.dash) dash += (dash.empty() ? "" : " ") + number(length);
      out += fmt::format(" stroke-dasharray=\"{}\"", dash);
    }
    if (stroke.clipped) out += fmt::format(" clip-path=\"url(#{}-clip)\"", id);
    out += "/>\n";
  }
  for (const Words& words : drawing.words) {
    const std::string at = fmt::format("x=\"{}\" y=\"{}\"", number(words.at.x), number(words.at.y));
    out += fmt::format("<text class=\"{} f\" {} font-size=\"{}\"", row_of(words.ink).css, at, number(words.size));
    if (words.anchor != Anchor::kStart) out += fmt::format(" text-anchor=\"{}\"", words.anchor == Anchor::kMiddle ? "middle" : "end");
    if (words.bold) out += " font-weight=\"bold\"";
    if (words.upright) out += fmt::format(" transform=\"rotate(-90 {} {})\"", number(words.at.x), number(words.at.y));
    out += fmt::format(">{}</text>\n", escaped(words.text));
  }
  return out;
}

std::string style_of(bool dark, const std::string& before) {
  std::string css;
  for (const InkRow& row : kInks) css += fmt::format("{}.{}{{--ink:{}}}\n", before, row.css, color_of(row.ink, dark));
  return css;
}

/// A colour for Cairo.
void set_color(cairo_t* painter, Ink ink) {
  const std::uint32_t rgb = row_of(ink).light;
  cairo_set_source_rgb(painter, (rgb >> 16 & 255) / 255.0, (rgb >> 8 & 255) / 255.0, (rgb & 255) / 255.0);
}

void paint(cairo_t* painter, const Drawing& drawing, const Stroke& stroke) {
  if (stroke.line.empty()) return;
  cairo_save(painter);
  if (stroke.clipped) {
    cairo_rectangle(painter, drawing.clip_from.x, drawing.clip_from.y, drawing.clip_to.x - drawing.clip_from.x, drawing.clip_to.y - drawing.clip_from.y);
    cairo_clip(painter);
  }
  set_color(painter, stroke.ink);
  cairo_new_path(painter);
  for (const Position& p : stroke.line) cairo_line_to(painter, p.x, p.y);
  if (stroke.closed) cairo_close_path(painter);
  if (stroke.filled) cairo_fill_preserve(painter);
  if (stroke.width > 0) {
    cairo_set_line_width(painter, stroke.width);
    cairo_set_line_join(painter, CAIRO_LINE_JOIN_ROUND);
    cairo_set_line_cap(painter, stroke.dash.empty() ? CAIRO_LINE_CAP_ROUND : CAIRO_LINE_CAP_BUTT);
    cairo_set_dash(painter, stroke.dash.data(), static_cast<int>(stroke.dash.size()), 0);
    cairo_stroke(painter);
  }
  cairo_restore(painter);
}

void paint(cairo_t* painter, const Words& words) {
  // Cairo stops for good at text that is not UTF-8: escaped bytes become U+FFFD, and nothing else changes.
  std::string text;
  for (std::size_t at = 0; at < words.text.size();) {
    const auto [code, length] = code_point(words.text, at);
    if (code == 0xfffd || code < 0x20) text += "\xef\xbf\xbd";
    else text += words.text.substr(at, length);
    at += length;
  }
  cairo_save(painter);
  set_color(painter, words.ink);
  cairo_select_font_face(painter, kFont, CAIRO_FONT_SLANT_NORMAL, words.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(painter, words.size);
  cairo_text_extents_t extents;
  cairo_text_extents(painter, text.c_str(), &extents);
  cairo_translate(painter, words.at.x, words.at.y);
  if (words.upright) cairo_rotate(painter, -kPi / 2);
  cairo_move_to(painter, words.anchor == Anchor::kStart ? 0 : words.anchor == Anchor::kMiddle ? -extents.x_advance / 2 : -extents.x_advance, 0);
  cairo_show_text(painter, text.c_str());
  cairo_restore(painter);
}

/// Appends to a std::string behind Cairo's back pointer; no exception may pass through Cairo's C.
cairo_status_t append(void* out, const unsigned char* data, unsigned int length) noexcept {
  try {
    static_cast<std::string*>(out)->append(reinterpret_cast<const char*>(data), length);
    return CAIRO_STATUS_SUCCESS;
  } catch (...) {
    return CAIRO_STATUS_NO_MEMORY;
  }
}

void require(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS) throw std::runtime_error(fmt::format("cannot paint a plot: {}", cairo_status_to_string(status)));
}

}  // namespace

Ink curve_ink(int k) {
  CHECK_GE(k, 0);
  return static_cast<Ink>(static_cast<int>(Ink::kCurve1) + k % kCurveInks);
}

std::string color_of(Ink ink, bool dark) { return fmt::format("#{:06x}", dark ? row_of(ink).dark : row_of(ink).light); }

double width_of(const std::string& text, double size) {
  double em = 0;
  for (std::size_t at = 0; at < text.size();) {
    const auto [code, length] = code_point(text, at);
    at += length;
    const bool ascii = code < 0x80;
    const char c = ascii ? static_cast<char>(code) : ' ';
    if (ascii && std::string_view("ijlI.,:;|!'()[] tfr").find(c) != std::string_view::npos) em += 0.41;
    else if (ascii && std::string_view("mwMW%@").find(c) != std::string_view::npos) em += 0.98;
    else if (ascii && c >= 'A' && c <= 'Z') em += 0.72;
    else em += 0.64;
  }
  return em * size;
}

std::vector<Position> circle(Position center, double radius) {
  constexpr int kSides = 16;
  std::vector<Position> line;
  for (int k = 0; k < kSides; ++k) line.push_back({center.x + radius * std::cos(2 * kPi * k / kSides), center.y + radius * std::sin(2 * kPi * k / kSides)});
  return line;
}

std::string svg_file(const Drawing& drawing) {
  std::string out = fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" font-family=\"{2}\">\n<style>\n", number(drawing.width),
                                number(drawing.height), kFontList);
  // Plain colours: programs that draw SVG outside of a browser know no CSS variables.
  for (const InkRow& row : kInks) out += fmt::format(".{0}.s{{stroke:{1}}}.{0}.f{{fill:{1}}}\n", row.css, color_of(row.ink, false));
  out += fmt::format("path{{fill:none;stroke-linejoin:round}}\n</style>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n{}</svg>\n", svg_body(drawing, "plot"));
  return out;
}

std::string svg_element(const Drawing& drawing, const std::string& id) {
  return fmt::format("<svg class=\"plot\" role=\"img\" viewBox=\"0 0 {} {}\" font-family=\"{}\">\n{}</svg>\n", number(drawing.width), number(drawing.height), kFontList, svg_body(drawing, id));
}

std::string svg_style() {
  return style_of(false, "") + "@media (prefers-color-scheme:dark){\n" + style_of(true, "") +
         "}\nsvg.plot path{fill:none;stroke-linejoin:round}svg.plot .s{stroke:var(--ink)}svg.plot .f{fill:var(--ink)}\n";
}

std::string png_file(const Drawing& drawing, double scale) {
  using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;
  using Painter = std::unique_ptr<cairo_t, decltype(&cairo_destroy)>;
  const auto pixels = [&](double length) { return static_cast<int>(std::ceil(length * scale)); };
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, pixels(drawing.width), pixels(drawing.height)), cairo_surface_destroy);
  require(cairo_surface_status(surface.get()));
  const Painter painter(cairo_create(surface.get()), cairo_destroy);
  cairo_set_source_rgb(painter.get(), 1, 1, 1);
  cairo_paint(painter.get());
  cairo_scale(painter.get(), scale, scale);
  for (const Stroke& stroke : drawing.strokes) paint(painter.get(), drawing, stroke);
  for (const Words& words : drawing.words) paint(painter.get(), words);
  require(cairo_status(painter.get()));
  std::string bytes;
  require(cairo_surface_write_to_png_stream(surface.get(), append, &bytes));
  return bytes;
}

std::string escaped(const std::string& text) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const auto [code, length] = code_point(text, at);
    if (code == '&') out += "&amp;";
    else if (code == '<') out += "&lt;";
    else if (code == '>') out += "&gt;";
    else if (code == '"') out += "&quot;";
    else if (code == '\'') out += "&#39;";
    else if (code == 0xfffd || (code < 0x20 && code != '\n' && code != '\t')) out += "\xef\xbf\xbd";
    else out += text.substr(at, length);
    at += length;
  }
  return out;
}

}  // namespace effuse::study
