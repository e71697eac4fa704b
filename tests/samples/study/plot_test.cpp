#include "samples/study/plot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <regex>

namespace effuse::study {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + what.size())) ++n;
  return n;
}

/// Measured beside a reference that is y = x on 0..10.
Plot plot_of(std::vector<double> x, std::vector<double> y, bool points = false) {
  Plot plot{"made_up", "Made up", "time [s]", "front [m]", false, false, {}};
  plot.curves.push_back({"measured", std::move(x), std::move(y), points, false});
  plot.curves.push_back({"exact", {0, 2, 4, 6, 8, 10}, {0, 2, 4, 6, 8, 10}, false, true});
  return plot;
}

std::string all_words(const Drawing& drawing) {
  std::string text;
  for (const Words& words : drawing.words) text += words.text + "\n";
  return text;
}

struct Given {
  double low, high;
  bool log;
};
class AxisOf : public testing::TestWithParam<Given> {};

TEST_P(AxisOf, HoldsItsRangeAndTwoToElevenDifferentLabelsInOrder) {
  const auto [low, high, log] = GetParam();
  const Axis axis = make_axis(low, high, log);
  EXPECT_LE(axis.first, low);
  EXPECT_GE(axis.last, high);
  EXPECT_GE(axis.share(low), 0);
  EXPECT_LE(axis.share(high), 1);
  std::vector<std::string> labels;
  for (std::size_t k = 0; k < axis.ticks.size(); ++k) {
    const double at = axis.share(axis.ticks[k].value);
    EXPECT_GE(at, -1e-6);
    EXPECT_LE(at, 1 + 1e-6);
    if (k > 0) {
      EXPECT_GT(at, axis.share(axis.ticks[k - 1].value));
    }
    if (!axis.ticks[k].label.empty()) labels.push_back(axis.ticks[k].label);
  }
  EXPECT_GE(labels.size(), 2u);
  EXPECT_LE(labels.size(), 11u);
  EXPECT_EQ(std::adjacent_find(labels.begin(), labels.end()), labels.end()) << "two neighbours read the same";
}

INSTANTIATE_TEST_SUITE_P(Ranges, AxisOf, testing::Values(
    Given{0, 1, false}, Given{0, 550, false}, Given{-3e-6, 7e-6, false}, Given{1e7, 1.5e9, false}, Given{300, 300, false}, Given{0, 0, false},
    Given{299.99, 300.01, false}, Given{-5, -1, false}, Given{1e-3, 1e3, true}, Given{1, 550, true}, Given{2, 3, true}, Given{1e-12, 1e12, true},
    Given{82, 1477, true}, Given{7, 7, true}, Given{1150, 1250, true}));

TEST(Axis, LabelsAreNumbersPeopleWrite) {
  const auto labels = [](const Axis& axis) {
    std::string text;
    for (const Axis::Tick& tick : axis.ticks)
      if (!tick.label.empty()) text += tick.label + " ";
    return text;
  };
  EXPECT_EQ(labels(make_axis(0, 10, false)), "0 2 4 6 8 10 ");
  EXPECT_EQ(labels(make_axis(-0.5, 0.5, false)), "−0.4 −0.2 0 0.2 0.4 ");
  EXPECT_EQ(labels(make_axis(0, 3e-5, false)), "0 10⁻⁵ 2·10⁻⁵ 3·10⁻⁵ ");
  EXPECT_EQ(labels(make_axis(1, 1000, true)), "1 10 100 1000 ");
  EXPECT_EQ(labels(make_axis(1e-6, 1e-3, true)), "10⁻⁶ 10⁻⁵ 10⁻⁴ 10⁻³ ");
}

TEST(PlotCsv, HoldsEveryNumberOfEveryCurve) {
  Plot plot = plot_of({0, 1, 2}, {0.1, kNan, -kInf});
  plot.curves[0].name = "dx 5 cm, \"fine\"";
  EXPECT_EQ(csv_of(plot),
            "\"dx 5 cm, \"\"fine\"\": time [s]\",\"dx 5 cm, \"\"fine\"\": front [m]\",exact: time [s],exact: front [m]\n"
            "0,0.1,0,0\n"
            "1,nan,2,2\n"
            "2,-inf,4,4\n"
            ",,6,6\n"
            ",,8,8\n"
            ",,10,10\n");
}

TEST(PlotCsv, NumbersReadBackBitForBit) {
  for (const double v : {0.1, 1.0 / 3, 1e-300, 6.02214076e23, -0.0, 5e-324}) EXPECT_EQ(std::strtod(csv_number(v).c_str(), nullptr), v);
}

TEST(PlotDrawing, DrawsTheReferenceFirstInBlack) {
  const Drawing drawing = draw(plot_of({0, 5, 10}, {0, 6, 9}));
  std::vector<Ink> inks;
  for (const Stroke& stroke : drawing.strokes)
    if (stroke.clipped) inks.push_back(stroke.ink);
  EXPECT_EQ(inks, (std::vector<Ink>{Ink::kReference, Ink::kCurve1}));
  const std::string words = all_words(drawing);
  EXPECT_LT(words.find("exact"), words.find("measured")) << "so does the legend";
  for (const char* said : {"Made up", "time [s]", "front [m]"}) EXPECT_NE(words.find(said), std::string::npos) << said;
}

TEST(PlotDrawing, PutsPointsWhereTheirNumbersAre) {
  const Drawing drawing = draw(plot_of({5}, {5}, true));
  const Axis axis = make_axis(0, 10, false);
  Position middle;
  int marks = 0;
  for (const Stroke& stroke : drawing.strokes) {
    if (!stroke.clipped || stroke.ink != Ink::kCurve1) continue;
    ++marks;
    for (const Position& p : stroke.line) {
      middle.x += p.x / static_cast<double>(stroke.line.size());
      middle.y += p.y / static_cast<double>(stroke.line.size());
    }
  }
  ASSERT_EQ(marks, 1);
  EXPECT_NEAR(middle.x, drawing.clip_from.x + axis.share(5) * (drawing.clip_to.x - drawing.clip_from.x), 0.01);
  EXPECT_NEAR(middle.y, drawing.clip_to.y - axis.share(5) * (drawing.clip_to.y - drawing.clip_from.y), 0.01);
}

TEST(PlotDrawing, MarksWhatBlewUpAtTheBorderAndKeepsTheAxes) {
  const Drawing calm = draw(plot_of({0, 5, 10}, {0, 5, 10}));
  const Drawing blown = draw(plot_of({0, 2, 5, 7, 9, 10}, {0, kNan, kInf, 1e30, -1e30, 10}));
  EXPECT_EQ(all_words(calm).find("border"), std::string::npos);
  EXPECT_NE(all_words(blown).find("4 points not finite"), std::string::npos) << all_words(blown);
  // The tick labels of both are the same: 1e30 does not squeeze the rest into a line.
  EXPECT_NE(all_words(blown).find("\n10\n"), std::string::npos);
  EXPECT_EQ(all_words(blown).find("10³⁰"), std::string::npos);
  int top = 0, bottom = 0;
  for (const Stroke& stroke : blown.strokes) {
    if (stroke.ink != Ink::kCurve1 || stroke.line.size() != 2 || stroke.clipped || stroke.line[0].y > blown.clip_to.y + 10) continue;
    const double middle = (stroke.line[0].y + stroke.line[1].y) / 2;
    top += std::abs(middle - blown.clip_from.y) < 1e-9;
    bottom += std::abs(middle - blown.clip_to.y) < 1e-9;
  }
  EXPECT_EQ(top, 3 * 2);  // two lines a cross
  EXPECT_EQ(bottom, 1 * 2);
}

TEST(PlotDrawing, AFewReferencePointsDoNotBoundACurve) {
  Plot plot{"viscosity", "", "", "", false, true, {}};
  plot.curves.push_back({"model", {900, 1000, 1200}, {1e7, 1e4, 60}, false, false});
  plot.curves.push_back({"measured elsewhere", {1150}, {116}, true, true});
  EXPECT_EQ(all_words(draw(plot)).find("border"), std::string::npos);
  plot.log_y = false;
  plot.curves[0].y = {4000, 1000, 60};
  EXPECT_EQ(all_words(draw(plot)).find("border"), std::string::npos);
  plot.curves[0].y[0] = 1e9;
  EXPECT_NE(all_words(draw(plot)).find("1 point not finite"), std::string::npos);
}

TEST(PlotDrawing, ALineLeavesTheFrameTowardsWhatBlewUp) {
  const Drawing drawing = draw(plot_of({0, 4, 6, 10}, {0, 4, 1e30, 10}));
  const auto line = std::find_if(drawing.strokes.begin(), drawing.strokes.end(), [](const Stroke& s) { return s.clipped && s.ink == Ink::kCurve1; });
  ASSERT_NE(line, drawing.strokes.end());
  ASSERT_EQ(line->line.size(), 4u) << "one line, not two";
  EXPECT_LT(line->line[2].y, drawing.clip_from.y);
}

TEST(PlotDrawing, ShowsEveryPlotWithinItsPicture) {
  std::vector<Plot> plots;
  plots.push_back(plot_of({}, {}));
  plots.push_back(Plot{"empty", "", "", "", true, true, {}});
  plots.push_back(plot_of({0, 1e-9}, {1e-9, 2e9}));
  plots.push_back(plot_of({kNan, kInf}, {kNan, kNan}, true));
  plots.back().log_x = plots.back().log_y = true;
  Plot many = plot_of({1, 2}, {1, 2});
  many.title = "A title that is so long that it does not fit into one line of the picture, nor, as it goes on and on and on about it, into two of them";
  many.y_label = many.title;
  for (int k = 0; k < 12; ++k) many.curves.push_back({"curve number " + std::to_string(k), {1, 2}, {1.0 * k, 2.0}, k % 2 == 0, false});
  many.curves.push_back({many.title + many.title, {1, 2}, {1, 2}, false, false});
  plots.push_back(many);
  for (const Plot& plot : plots) {
    const Drawing drawing = draw(plot);
    for (const Words& words : drawing.words) {
      const double wide = words.upright ? words.size : width_of(words.text, words.size), begin = words.anchor == Anchor::kStart ? 0 : words.anchor == Anchor::kMiddle ? wide / 2 : wide;
      EXPECT_GE(words.at.x - begin, 0) << words.text;
      if (!words.upright) {
        EXPECT_LE(words.at.x - begin + wide, drawing.width) << words.text;
      }
      EXPECT_LE(words.at.y, drawing.height) << words.text;
      EXPECT_GE(words.at.y, words.size * 0.8) << words.text;
    }
    for (const Stroke& stroke : drawing.strokes)
      for (const Position& p : stroke.line) EXPECT_TRUE(std::isfinite(p.x) && std::isfinite(p.y));
  }
}

TEST(PlotDrawing, AMillionMarksBecomeNoMoreThanCanBeSeen) {
  std::vector<double> x(1000000), y(1000000);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = y[i] = 10 * static_cast<double>(i) / 1e6;
  EXPECT_LT(draw(plot_of(x, y, true)).strokes.size(), 4000u);
  EXPECT_LT(svg_file(draw(plot_of(x, y))).size(), 200000u);
}

TEST(PlotSvg, IsWholeEscapedAndFetchesNothing) {
  Plot plot = plot_of({0, 1}, {0, 1});
  plot.title = "a < b & \"c\" \xff";
  const std::string file = svg_file(draw(plot)), element = svg_element(draw(plot), "plot-x");
  EXPECT_NE(file.find("a &lt; b &amp; &quot;c&quot; \xef\xbf\xbd"), std::string::npos);
  for (const std::string& svg : {file, element}) {
    EXPECT_EQ(count(svg, "<svg"), 1u);
    EXPECT_EQ(count(svg, "</svg>"), 1u);
    EXPECT_EQ(count(svg, "<text"), count(svg, "</text>"));
    EXPECT_FALSE(std::regex_search(svg, std::regex("(href|src)\\s*=|@import|url\\((?!#)"))) << "something from outside";
  }
  EXPECT_NE(file.find("xmlns=\"http://www.w3.org/2000/svg\""), std::string::npos) << "a namespace, not a place";
}

TEST(PlotPng, HasTheDrawingsSizeTimesTheScale) {
  const Drawing drawing = draw(plot_of({0, 1}, {0, 1}));
  const std::string png = png_file(drawing, 2);
  ASSERT_GT(png.size(), 1000u);
  EXPECT_EQ(png.substr(1, 3), "PNG");
  const auto big_endian = [&](std::size_t at) { return (static_cast<unsigned char>(png[at + 2]) << 8) + static_cast<unsigned char>(png[at + 3]); };
  EXPECT_EQ(big_endian(16), static_cast<int>(std::ceil(2 * drawing.width)));
  EXPECT_EQ(big_endian(20), static_cast<int>(std::ceil(2 * drawing.height)));
}

TEST(PlotPng, SurvivesTextThatIsNoText) {
  Plot plot = plot_of({0, 1}, {0, 1});
  plot.title = std::string("\xc3\x28 \xff \x01 \0 end", 12);
  EXPECT_GT(png_file(draw(plot), 1).size(), 1000u);
}

/// Relative luminance of "#rrggbb" (WCAG 2).
double luminance(const std::string& color) {
  double sum = 0;
  const double weight[] = {0.2126, 0.7152, 0.0722};
  for (std::size_t k = 0; k < 3; ++k) {
    const double c = std::stoi(color.substr(1 + 2 * k, 2), nullptr, 16) / 255.0;
    sum += weight[k] * (c <= 0.03928 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
  }
  return sum;
}

TEST(PlotColors, StandOutFromTheirPage) {
  const auto contrast = [](const std::string& a, const std::string& b) {
    const double x = luminance(a) + 0.05, y = luminance(b) + 0.05;
    return std::max(x, y) / std::min(x, y);
  };
  // Okabe and Ito's light blue and pink are pale on white: they come last, and marks and dashes help.
  for (int k = 0; k < kCurveInks; ++k) {
    EXPECT_GT(contrast(color_of(curve_ink(k), true), "#161616"), 3) << k;
    EXPECT_GT(contrast(color_of(curve_ink(k), false), "#ffffff"), k < 3 ? 3 : 2) << k;
  }
  EXPECT_GT(contrast(color_of(Ink::kText, true), "#161616"), 7);
  EXPECT_GT(contrast(color_of(Ink::kText, false), "#ffffff"), 7);
}

}  // namespace
}  // namespace effuse::study
