// A fingertip of silicone for a bar load cell: its carrier and the mould of its skin. Millimetres.
// openscad -D 'part="carrier"' -o carrier.stl hardware/finger.scad
// part: "carrier", "mould", "core", or "assembly" to look at.
part = "assembly";

// The skin: a cap whose end is part of a sphere, with ridges across the slide.
diameter = 20;        // of the tip
end_radius = 14;      // of the sphere that touches
skin = 2;             // thickness
skirt = 7;            // length of the skin's wall, over the carrier's cup
ridge_height = 0.2;   // the paper, "BioTac"
ridge_spacing = 0.4;
// The carrier's cup: silicone gel fills it, and what feels lies in the gel.
wall = 1.6;
floor = 2.4;
lead = [8, 2];        // slot for the flex cable or the wires
// The end of the load cell, to which the carrier is screwed. Measure yours.
cell = [80, 12.7, 12.7];
cell_holes = 15;      // between the two holes of an end
screw = 4.3;          // clearance of M4
flange = 3;
reach = 16;           // from the tip's middle to the first of them

$fn = 96;
inner = diameter - 2 * skin;
// what the sphere's end stands out beyond the wall
rise = end_radius - sqrt(pow(end_radius, 2) - pow(diameter / 2, 2));

// The tip's outside, pointing down from z = 0, larger by `more` all round its end.
module outside(more = 0) {
  intersection() {
    translate([0, 0, -skirt - rise - more]) cylinder(d = diameter, h = skirt + rise + more);
    translate([0, 0, -skirt - rise + end_radius]) union() {
      sphere(r = end_radius + more);
      cylinder(d = diameter, h = skirt + rise);
    }
  }
}

module ridges() {
  for (x = [-diameter / 2 : ridge_spacing : diameter / 2])
    translate([x - ridge_spacing / 4, -diameter, -skirt - rise - 1])
      cube([ridge_spacing / 2, 2 * diameter, rise + 1]);
}

// The skin as it comes out of the mould.
module tip() {
  outside();
  intersection() { outside(ridge_height); ridges(); }
}

// What keeps the skin hollow.
module inside() {
  translate([0, 0, -skirt]) cylinder(d = inner, h = skirt + 0.01);
  intersection() {
    translate([0, 0, -skirt - rise]) cylinder(d = inner, h = rise + 1);
    translate([0, 0, -skirt - rise + end_radius]) sphere(r = end_radius - skin);
  }
}

// Lies with its opening up; print it of resin in layers of 0.05 mm or less, or the ridges are lost.
module mould() {
  difference() {
    translate([-16, -16, -skirt - rise - 5]) cube([32, 32, skirt + rise + 5]);
    tip();
    // pins of the core
    for (x = [-12.5, 12.5]) translate([x, 0, -4]) cylinder(d = 3.2, h = 5);
  }
}

// Hangs in the mould by its plate; two holes let the air and what is too much out.
module core() {
  difference() {
    union() {
      inside();
      translate([-16, -8, 0]) cube([32, 16, 3]);
      for (x = [-12.5, 12.5]) translate([x, 0, -3.5]) cylinder(d = 3, h = 3.6);
    }
    for (y = [-1, 1]) translate([0, y * (diameter - skin) / 2, -1]) cylinder(d = 1.5, h = 5);
  }
}

// A cup that the skin is pulled over, beyond the cell's free end so that a screwdriver gets at both screws. A bar cell
// measures the force, wherever on its end that acts.
module carrier() {
  left = -reach - cell_holes - 6;
  right = 0;
  difference() {
    union() {
      translate([left, -cell[1] / 2, 0]) cube([right - left, cell[1], flange]);
      cylinder(d = inner + 4, h = flange);
      translate([0, 0, -skirt]) cylinder(d = inner, h = skirt);
      // a rim that holds the skin's edge
      translate([0, 0, -1.2]) cylinder(d1 = inner, d2 = inner + 0.8, h = 1.2);
    }
    translate([0, 0, -skirt - 1]) cylinder(d = inner - 2 * wall, h = skirt + 1 - floor);
    translate([-lead[0] / 2, -lead[1] / 2, -skirt]) cube([lead[0], lead[1], skirt + flange + 1]);
    for (x = [0, cell_holes]) translate([-reach - x, 0, -1]) cylinder(d = screw, h = flange + 2);
  }
}

module assembly() {
  color("Silver") translate([-reach - cell_holes - cell[0] + cell_holes + 5.5, -cell[1] / 2, flange]) difference() {
    cube(cell);
    // the thinned middle that bends
    for (x = [-8, 8]) translate([cell[0] / 2 + x, -1, cell[2] / 2]) rotate([-90, 0, 0]) cylinder(d = 9, h = cell[1] + 2);
  }
  color("DimGray") carrier();
  color("BurlyWood") difference() { tip(); inside(); translate([-20, -20, -30]) cube([40, 20, 40]); }
  // what feels, in its gel
  color("SeaGreen") translate([-5, -4, -skirt - 0.8]) cube([10, 8, 0.8]);
}

if (part == "carrier") rotate([180, 0, 0]) carrier();
if (part == "mould") mould();
if (part == "core") rotate([180, 0, 0]) core();
if (part == "assembly") assembly();
