// A holder that hangs the finger beside a 3D printer's nozzle, or on the lever of the rig. The finger rides on a
// vertical ball slide and rests on a stop by its own weight: nothing but that weight, friction and inertia presses.
// Millimetres. A test weighs it again from these measures, and the book's table of forces is made of them.
// openscad -D 'part="back"' -o back.stl hardware/printer.scad
// part: "back", "carriage", "corner", "saddle", "clamp", "tray", or "assembly", "assembly_v6" to look at.
part = "assembly";

// What the finger hangs on: screws of the fan in front of the hot end (40 mm fan: 32), or of the lever's nut.
pattern = 32;         // between two of its four screws
pattern_up = 33;      // its middle above the nozzle's tip. Measure yours
pattern_play = 4;     // up and down
fan = 10;             // thickness of the fan that stays behind the holder
heat_sink = [22.3, 20]; // of a V6: diameter and length that the clamp grips; [16, 12] grips its collar

// The finger, as in finger.scad.
cell = [80, 12.7, 12.7];
cell_bore = 9;        // of the two that thin its middle
cell_holes = 15;
cell_end = 5.5;       // from an end to its first hole
cell_screw = 5.3;     // clearance of M5, at the end that is held
reach = 16;           // from the tip's middle to the first hole
tip_below = 14.2;     // flange, skirt and rise
tip_mass = 6.5;       // g: carrier (2650 mm3), skin, gel and what lies in it

// The slide: rail MGN9, 100 mm, with one short block, MGN9C.
rail = [9, 6.5, 100];
rail_first = 10;      // to its first hole; the others 20 mm on
block = [20, 10, 28.9]; // width, height above the rail's foot, length
block_holes = [15, 10];
block_mass = 16;      // g, Hiwin's catalogue; weigh yours
ball_span = 12;       // between the outer balls that carry a tilting moment
friction = 0.004;     // of balls, Hiwin's catalogue
drag = 0.157;         // N: a block that slides down by its own 16 g has less; take no other
skin_rate = 1.8;      // N/mm, of skin and gel at 1.6 N: the simulated finger's
cable_rate = 0.005;   // N/mm, of the cable's loop: chosen

// The dead weight: an M8 x 40 bolt, its nut, washers DIN 9021 and 125 of 8.4 mm, of steel.
goal = 142;           // g that move in all: 1.39 N
washer = [24, 8.4, 2];
washers = 3;
small_washer = [16, 8.4, 1.6]; // DIN 125, to be exact
small_washers = 1;
steel = 7.85e-3;      // g a mm3
aluminium = 2.7e-3;
petg = 1.27e-3;
filled = 0.8;         // share of a printed part that is not air: 4 walls, 40 %
carriage_volume = 22649; // mm3, of carriage.stl
carriage_middle = -30.9; // of its mass, x
screws_mass = 14;     // g: 4 M3 x 8, 2 M5 x 16, 2 M4 x 8, M3 x 12 of the stop
cable_mass = 4;       // g: the half of its loop that the carriage bears

drop = 20;            // the tip below the nozzle
travel = 15;          // the finger yields so far before the nozzle gets within 5 mm of the sample
plate = 7;
web = 5;
shelf = [132, 16, 6];
standoff = 1.6;
loop = 2.2;           // holes of a cable tie
$fn = 64;

bolt_mass = steel * (PI / 4 * pow(8, 2) * 40 + 13 * 13 * 0.866 * 5.3);
nut_mass = steel * (13 * 13 * 0.866 - PI / 4 * pow(8, 2)) * 6.8;
function ring(w) = steel * PI / 4 * (pow(w[0], 2) - pow(w[1], 2)) * w[2];
weight = bolt_mass + nut_mass + washers * ring(washer) + small_washers * ring(small_washer);
cell_mass = aluminium * (cell[0] * cell[1] * cell[2] - PI / 2 * pow(cell_bore, 2) * cell[1]);
carriage_mass = petg * filled * carriage_volume;
moving = block_mass + cell_mass + tip_mass + carriage_mass + screws_mass + cable_mass + weight;
echo(weight = weight, moving = moving, newton = moving * 9.81e-3);
assert(abs(moving - goal) < ring(small_washer) / 2, "take another number of washers");
assert(travel + 5 <= drop, "the nozzle would meet the sample before the finger has yielded");

// z = 0 is the nozzle's tip, y = 0 the plate's front, x = 0 the middle of the rail and of the tip.
rest = -drop + tip_below + cell[2] + standoff;  // the shelf's underside when the carriage rests
foot = 2;             // the plate's lower edge, and the rail's
middle = -block[1] - web - 1 - cell[1] / 2;      // the cell's middle, y
held = -reach - cell[0] + 2 * cell_end;       // its outer screw
block_up = rest + 1 + block[2] / 2;
left = held - 9;
weight_at = 26;

module four(size) {
  for (x = [-1, 1], z = [-1, 1]) translate([x * size[0] / 2, 0, z * size[1] / 2]) rotate([90, 0, 0]) children();
}

// A slot through a plate, long upwards: four of them, where the fan has its screws.
module slots(depth, play = pattern_play) {
  translate([0, 1, pattern_up]) four([pattern, pattern])
    hull() for (up = [-play, play]) translate([0, up, 0]) cylinder(d = 4.4, h = depth + 2);
}

module upright(size, r = 3) {
  rotate([90, 0, 0]) hull() for (x = [r, size[0] - r], y = [r, size[2] - r]) translate([x, y, 0]) cylinder(r = r, h = size[1]);
}

// Carries the rail, and the stop on which the carriage rests.
module back() {
  difference() {
    union() {
      translate([-pattern / 2 - 7, plate, foot]) upright([pattern + 14, plate, pattern_up + pattern / 2 + 8 - foot]);
      translate([-10, plate, foot]) upright([20, plate, rail[2] + 5]);
      // the stop: two feet beside the rail, their tops at the carriage's underside
      for (side = [-1, 1]) translate([side * 13.75 - 2.25, -block[1] - web, foot]) cube([4.5, block[1] + web + plate, rest - foot]);
      // keeps the block on the rail
      translate([-10, -8.5, foot + rail[2]]) cube([20, 8.5 + plate, 5]);
    }
    translate([0, plate, 0]) slots(plate);
    // the rail's screws M3 x 10, their nuts in the plate's back
    for (z = [0 : 20 : rail[2] - 2 * rail_first]) translate([0, 0, foot + rail_first + z]) rotate([-90, 0, 0]) {
      translate([0, 0, -1]) cylinder(d = 3.3, h = plate + 2);
      translate([0, 0, plate - 2.6]) cylinder(d = 6.5, h = 3, $fn = 6);
    }
    // the cable's tie
    for (x = [-6, 6]) translate([x, -1, foot + rail[2] - 20]) rotate([-90, 0, 0]) cylinder(d = loop + 1.4, h = plate + 2);
  }
}

// Screwed on the block: bears the cell's held end, the dead weight, and the screw that stops the cell's free end.
module carriage() {
  difference() {
    union() {
      translate([left, -block[1] - web, rest]) cube([shelf[0], web, shelf[2]]);
      translate([left, -block[1] - web, rest]) cube([-left + 14, web, 14]);
      translate([-14, -block[1] - web, rest]) cube([28, web, block[2] / 2 + block_holes[1] / 2 + 6]);
      translate([left, -block[1] - web - shelf[1], rest]) cube([shelf[0], shelf[1] + web, shelf[2]]);
      translate([left, -block[1] - web - shelf[1], rest - standoff]) cube([cell_holes + 17, shelf[1] + web, standoff + 1]);
    }
    translate([0, -block[1] + 1, block_up]) four(block_holes) cylinder(d = 3.4, h = web + 2);
    for (x = [0, cell_holes]) translate([held + x, middle, rest - standoff - 1]) cylinder(d = cell_screw, h = shelf[2] + standoff + 2);
    // the stop, M3, above the cell between the screws of its free end
    translate([-reach - cell_holes / 2, middle, rest - 1]) cylinder(d = 2.6, h = shelf[2] + 2);
    translate([weight_at, middle, rest - 1]) cylinder(d = 8.4, h = shelf[2] + 2);
    for (x = [0, 10]) translate([left + 36 + x, 0, rest + 10]) rotate([90, 0, 0]) cylinder(d = loop + 1.4, h = 40);
  }
}

aside = pattern / 2 + 8;
turned = pattern + 20;
// Turns the slide by 90 degrees, for a finger that slides along Y.
module corner() {
  low = pattern_up - turned / 2;
  difference() {
    union() {
      translate([-pattern / 2 - 7, plate, low]) upright([pattern / 2 + 7 + aside + plate, plate, turned]);
      translate([aside, -turned, low]) cube([plate, turned + plate, turned]);
      // what stiffens it, below the screws
      translate([aside, 0, low]) linear_extrude(3) polygon([[0, 0], [-12, 0], [0, 8 - turned]]);
    }
    translate([0, plate, 0]) slots(plate);
    translate([aside, -turned / 2, 0]) rotate([0, 0, 90]) slots(plate, 0);
  }
}

// Half a clamp for a round heat sink; holder or corner is screwed to its flat side.
depth = heat_sink[0] / 2 + 8;
ear = heat_sink[0] / 2 + 5;
apart = heat_sink[1] < 18 ? 0 : heat_sink[1] - 10;
module saddle() {
  difference() {
    union() {
      translate([-pattern / 2 - 7, plate, pattern_up - pattern / 2 - 8]) upright([pattern + 14, plate, pattern + 16]);
      translate([-ear - 5, 0, pattern_up - heat_sink[1] / 2]) cube([2 * ear + 10, depth - 0.4, heat_sink[1]]);
    }
    grip();
    translate([0, plate, 0]) slots(plate, 0);
    // nuts M3 that lie in the flat side
    translate([0, 2.6, pattern_up]) four([2 * ear, apart]) rotate([0, 0, 30]) cylinder(d = 6.5, h = 4, $fn = 6);
  }
}
module clamp() {
  difference() {
    translate([-ear - 5, depth + 0.4, pattern_up - heat_sink[1] / 2]) cube([2 * ear + 10, heat_sink[0] / 2 + 4, heat_sink[1]]);
    grip();
  }
}
module grip() {
  translate([0, depth, 0]) cylinder(d = heat_sink[0] + 0.2, h = 200);
  translate([0, 60, pattern_up]) four([2 * ear, apart]) cylinder(d = 3.4, h = 70);
}

// Ties the NUCLEO to the printer's profile.
module tray() {
  difference() {
    cube([140, 76, 3]);
    for (x = [20, 70, 120], y = [6, 70]) translate([x, y, -1]) cylinder(d = loop + 2, h = 5);
    for (x = [20, 120], y = [30, 46]) translate([x, y, -1]) cylinder(d = loop + 2, h = 5);
    translate([35, 18, -1]) cube([70, 40, 5]);
  }
  for (y = [0, 74]) translate([0, y, 0]) cube([140, 2, 5]);
}

// What is bought, to look at.
module slide_and_finger() {
  color("Silver") translate([-rail[0] / 2, -rail[1], foot]) cube([rail[0], rail[1], rail[2]]);
  color("DarkSlateGray") translate([-block[0] / 2, -block[1], block_up - block[2] / 2]) cube([block[0], block[1] - 2, block[2]]);
  color("SteelBlue") back();
  color("LightSteelBlue") carriage();
  color("Silver") translate([held - cell_end, middle - cell[1] / 2, rest - standoff - cell[2]]) difference() {
    cube(cell);
    for (x = [-8, 8]) translate([cell[0] / 2 + x, -1, cell[2] / 2]) rotate([-90, 0, 0]) cylinder(d = cell_bore, h = cell[1] + 2);
  }
  color("DimGray") translate([-reach - cell_holes - 6, middle - cell[1] / 2, -drop + tip_below - 3]) cube([reach + cell_holes + 6, cell[1], 3]);
  color("BurlyWood") translate([0, middle, -drop]) {
    cylinder(d1 = 12, d2 = 20, h = 4.2);
    translate([0, 0, 4.2]) cylinder(d = 20, h = 7);
  }
  color("Gray") translate([weight_at, middle, rest]) {
    translate([0, 0, -5.3]) cylinder(d = 14, h = 5.3, $fn = 6);
    translate([0, 0, shelf[2]]) cylinder(d = washer[0], h = washers * washer[2]);
    translate([0, 0, shelf[2] + washers * washer[2]]) cylinder(d = 14, h = 6.8, $fn = 6);
    cylinder(d = 8, h = 34.7);
  }
}

module hot_end() {
  color("Goldenrod") cylinder(d1 = 1, d2 = 7, h = 5);
  color("Gray") translate([-8, -8, 5]) cube([16, 20, 11]);
}

module bed() {
  color("DarkGray", 0.6) translate([-60, -130, -drop - 5]) cube([150, 190, 2]);
  color("Peru") translate([20, -120, -drop - 3]) cube([50, 140, 3]);
}

module assembly() {
  hot_end();
  color("DimGray") translate([-20, -26, 16]) cube([40, 40, 40]);
  color("Black") translate([-20, -26 - fan, pattern_up - 20]) cube([40, fan, 40]);
  translate([0, -26 - fan - plate, 0]) {
    color("Teal") corner();
    translate([aside + 2 * plate, -turned / 2, 0]) rotate([0, 0, 90]) slide_and_finger();
  }
  bed();
}

module assembly_v6() {
  hot_end();
  color("LightGray") for (z = [20 : 2.4 : 45]) translate([0, 0, z]) cylinder(d = heat_sink[0], h = 1.2);
  translate([0, -depth, 0]) {
    color("Teal") saddle();
    color("Teal") clamp();
    translate([0, -plate, 0]) slide_and_finger();
  }
}

if (part == "back") rotate([-90, 0, 0]) back();
if (part == "carriage") rotate([-90, 0, 0]) carriage();
if (part == "corner") corner();
if (part == "saddle") rotate([90, 0, 0]) saddle();
if (part == "clamp") rotate([-90, 0, 0]) clamp();
if (part == "tray") tray();
if (part == "assembly") assembly();
if (part == "assembly_v6") assembly_v6();
