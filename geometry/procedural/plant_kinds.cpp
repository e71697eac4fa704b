#include "geometry/procedural/plant.h"

namespace effuse::geometry {

namespace {

std::vector<PlantKind> make_kinds() {
  std::vector<PlantKind> kinds;
  TurtleOptions t;

  // A trunk that forks into two or three at every height, each fork rolled by the golden angle.
  t.thickness = 0.07;
  t.leaf = 0.06;
  kinds.push_back({"tree",
                   "a broad crown on a short trunk",
                   {"!(0.07)F(0.16)/(40)A(0.2, 0.05)",
                    {{"A(l, w)", "w > 0.005", "!(w)F(l)[&(32)A(l*0.82, w*0.68)]/(137.5)[&(28)A(l*0.78, w*0.64)]/(137.5)[&(36)A(l*0.72, w*0.6)]", 2},
                     {"A(l, w)", "w > 0.005", "!(w)F(l)[&(24)A(l*0.86, w*0.72)]/(137.5)[&(38)A(l*0.74, w*0.6)]", 1},
                     {"A(l, w)", "w <= 0.005", "!(w)F(l*0.6)[&(40)~]/(120)[&(50)~]/(120)[&(35)~]~", 1}},
                    {}},
                   t,
                   9});

  t = {};
  t.thickness = 0.02;
  t.leaf = 0.05;
  kinds.push_back({"bush",
                   "many stems from the ground, leaves all along",
                   {"[&(20)B(0.22, 0.02)]/(72)[&(34)B(0.2, 0.02)]/(72)[&(26)B(0.22, 0.02)]/(72)[&(38)B(0.2, 0.02)]/(72)[&(30)B(0.21, 0.02)]",
                    {{"B(l, w)", "w > 0.004", "!(w)F(l)[&(35)~]/(90)[&(26)B(l*0.8, w*0.7)]/(160)[^(28)B(l*0.75, w*0.65)]", 3},
                     {"B(l, w)", "w > 0.004", "!(w)F(l)[&(50)~]/(130)&(12)B(l*0.85, w*0.75)", 1},
                     {"B(l, w)", "w <= 0.004", "!(w)F(l*0.5)[&(40)~]/(140)[&(40)~]~", 1}},
                    {}},
                   t,
                   8});

  // The stem goes on; whorls of five grow out nearly level, shorter the higher.
  t = {};
  t.thickness = 0.045;
  t.leaf = 0.045;
  kinds.push_back({"conifer",
                   "a straight stem with whorls of branches",
                   {"!(0.045)F(0.12)S(0.1, 0.36, 0.04)",
                    {{"S(h, l, w)", "l > 0.03",
                      "!(w)F(h)[W(l, w)]/(72)[W(l, w)]/(72)[W(l, w)]/(72)[W(l, w)]/(72)[W(l, w)]/(31)S(h*0.93, l*0.86, w*0.88)", 1},
                     {"S(h, l, w)", "l <= 0.03", "!(w)F(h)~", 1},
                     {"W(l, w)", "", "&(82)!(w*0.3)T(l*0.25, w*0.3)T(l*0.25, w*0.25)T(l*0.25, w*0.2)T(l*0.25, w*0.15)", 1},
                     {"T(l, w)", "", "!(w)F(l)^(4)$[+(55)~][-(55)~][+(20)^(30)~][-(20)^(30)~]~", 1}},
                    {}},
                   t,
                   20});

  t = {};
  t.thickness = 0.006;
  t.thinning = 0.6;
  kinds.push_back({"grass",
                   "a tuft of blades",
                   {"[/(0)&(8)G(0.3)][/(50)&(14)G(0.28)][/(105)&(10)G(0.33)][/(160)&(18)G(0.26)][/(215)&(9)G(0.31)][/(265)&(16)G(0.27)][/(310)&(12)G(0.3)]",
                    {{"G(l)", "l > 0.06", "!(0.006)F(l)&(9)G(l*0.72)", 2}, {"G(l)", "l > 0.06", "!(0.006)F(l)&(15)G(l*0.66)", 1}},
                    {}},
                   t,
                   7});
  return kinds;
}

}  // namespace

const std::vector<PlantKind>& plant_kinds() {
  static const std::vector<PlantKind> kinds = make_kinds();
  return kinds;
}

}  // namespace effuse::geometry
