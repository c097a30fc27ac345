// Tools that are finer than the cloth in places (docs/STABILITY.md): openscad -D 'part="fin-5"' -o fin-5.stl thin.scad [mm]
part = "fin-5";
module plate() { translate([-100, -100, -20]) cube([200, 200, 20]); }
if (part == "fin-5") { plate(); translate([0.4, -80, -1]) cube([5, 160, 61]); }
if (part == "fin-2") { plate(); translate([2, -80, -1]) cube([2, 160, 31]); }
if (part == "fin-oblique-3") { plate(); rotate(30) translate([1, -80, -1]) cube([3, 160, 31]); }
if (part == "ribs-crossed-4") { plate(); for (a = [0, 90]) rotate(a) translate([-2.3, -70, -1]) cube([4, 140, 26]); }
if (part == "pins-16") { plate(); for (i = [-1.5:1.5], j = [-1.5:1.5]) translate([37 * i + 1, 37 * j + 2, -1]) cylinder(d = 4, h = 31, $fn = 24); }
if (part == "pin-3") { plate(); translate([2, 2.5, -1]) cylinder(d = 3, h = 41, $fn = 32); }
if (part == "slot-10") { difference() { plate(); translate([-4, -90, -15]) cube([10, 180, 20]); } }
if (part == "pocket-60") { difference() { plate(); translate([-31, -29, -15]) cube([60, 60, 20]); } }
if (part == "roof-60") { translate([0, 100, -20]) rotate([90, 0, 0]) linear_extrude(200) polygon([[-60, 0], [60, 0], [0, 103.9]]); }
if (part == "steps") { plate(); for (k = [0:3]) translate([14 * k - 10, -80, -1]) cube([90 - 14 * k, 160, 8 * k + 9]); }
if (part == "star") { plate(); translate([1, 2, -1]) linear_extrude(31) polygon([for (k = [0:9]) let (r = k % 2 == 0 ? 60 : 22) [r * cos(36 * k), r * sin(36 * k)]]); }
if (part == "comb-2") { plate(); for (k = [-4:4]) translate([9 * k + 0.7, -60, -1]) cube([2, 120, 21]); }
