use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_task::env::{
    Draping, EnvConfig, EpisodeState, Quantity, Scatter, Spread, Worlds, mean_and_worst_quarter,
};
use drape_task::search::{Judge, Moves, Order, choose, moves};
use std::sync::Arc;
use std::time::Instant;
fn sequences(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    order: Order,
    n: usize,
    seed: u64,
) -> Vec<Vec<u32>> {
    let mut d = Draping::new(scene.clone(), env, n).unwrap();
    let mut st: Vec<Stream> = (0..n as u32)
        .map(|k| Stream::new(seed, Purpose::Evaluation, k))
        .collect();
    let all = d.play(|d| {
        (0..n)
            .map(|k| choose(d, k, order, k as f64 / n as f64, &mut st[k]))
            .collect()
    });
    let v = |e: &EpisodeState| e.presses().iter().map(|&(v, _)| v).collect();
    all.iter().map(|p| v(&p.end)).collect()
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let steps: u64 = a[1].parse().unwrap();
    let seed: u64 = a[2].parse().unwrap();
    let second: f64 = a[3].parse().unwrap();
    let candidates: usize = a[4].parse().unwrap();
    let worlds_n: u64 = a[5].parse().unwrap();
    let path = a.get(6).map_or("configs/quickstart.toml", |p| p);
    let table: toml::Table = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut base: SceneConfig = table
        .get("scene")
        .cloned()
        .map_or(SceneConfig::rib(), |v| v.try_into().unwrap());
    base.resolve(std::path::Path::new(path).parent().unwrap());
    let mut et: toml::Table = table["env"].clone().try_into().unwrap();
    et.entry("crop").or_insert(true.into());
    let mut env: EnvConfig = et.try_into().unwrap();
    env.costs.second = second;
    let t = Instant::now();
    let scene = Arc::new(Scene::new(&base, |_| ()).unwrap());
    eprintln!("scene {:.2}s", t.elapsed().as_secs_f64());
    let s = |x| Spread::Deviation(x);
    let scatter = Scatter {
        risk: 0.5,
        substep_rates: vec![2400.0],
        spreads: [
            (Quantity::ShiftMm, Spread::Range([-2.0, 2.0])),
            (Quantity::Friction, Spread::Range([0.8, 1.2])),
            (Quantity::Bending, Spread::Range([0.7, 1.4])),
            (Quantity::Stencil, Spread::Range([0.92, 1.08])),
            (Quantity::PressOffsetMm, s(1.0)),
        ]
        .into_iter()
        .collect(),
    };
    let t = Instant::now();
    let worlds = Arc::new(Worlds::new(&scene, &scatter, (16, seed), |_| ()).unwrap());
    eprintln!("worlds {:.2}s", t.elapsed().as_secs_f64());
    let t = Instant::now();
    let mut judge = Judge::new(&scene, &env, &worlds, false).unwrap();
    eprintln!("judge {:.2}s", t.elapsed().as_secs_f64());
    let mut starts = Vec::new();
    for (o, n) in [(Order::Outwards, 16), (Order::Sweep, 8), (Order::Random, 8)] {
        starts.extend(sequences(&scene, &env, o, n, seed));
    }
    if let Some(p) = a.get(7) {
        let v: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(p).unwrap()).unwrap();
        let l = |v: &serde_json::Value| -> Vec<u32> {
            serde_json::from_value(v["vertices"].clone()).unwrap()
        };
        starts.push(l(&v));
        starts.extend(v["others"].as_array().unwrap().iter().map(l));
    }
    let lists: Vec<&[u32]> = starts.iter().map(|l| &**l).collect();
    let t = Instant::now();
    let r = judge.race(&lists, 1_000_000..1_000_012, 8, |_, _| ());
    eprintln!(
        "race {:.2}s spent {} {:?}",
        t.elapsed().as_secs_f64(),
        judge.spent(),
        r
    );
    let starts: Vec<Vec<u32>> = r[..8].iter().map(|&(k, _)| starts[k].clone()).collect();
    let t = Instant::now();
    let method = Moves {
        candidates,
        chains: worlds_n as usize,
        ..Moves::default()
    };
    let found = moves(&mut judge, &starts, method, (steps, seed), |s| {
        if s.round % 10 == 0 {
            eprintln!(
                "{} {:.1}s spent {} best {:.4}",
                s.round,
                t.elapsed().as_secs_f64(),
                s.spent,
                s.best
            );
        }
        true
    });
    eprintln!(
        "{} rounds, converged {}, {:.1}s",
        found.rounds,
        found.has_converged,
        t.elapsed().as_secs_f64()
    );
    let t = Instant::now();
    let test = Arc::new(Worlds::new(&scene, &scatter, (24, seed + 1000), |_| ()).unwrap());
    let mut env2 = env.clone();
    env2.costs.second = 0.0;
    env2.costs.undraped = 0.0;
    let mut proof = Judge::new(&scene, &env2, &test, true).unwrap();
    let lists: Vec<&[u32]> = found.orders.iter().map(|l| &*l.0).take(4).collect();
    let w: Vec<u64> = (0..24).collect();
    let s = proof.scores(&lists, &w, |_, _| ());
    for (k, s) in s.iter().enumerate() {
        let [m, q] = mean_and_worst_quarter(s);
        let mut d = Draping::new(scene.clone(), &env, 1).unwrap();
        let _ = d.replay(&[lists[k]], |_, _, _| ());
        let f = d.task(0).figures(&d.points(0));
        println!(
            "judge {:.4} | mean {:.4} quarter {:.4} worst {:.4} | {} {:.0} s",
            found.orders[k].1,
            m,
            q,
            s.iter().copied().fold(1.0, f64::min),
            f.text(),
            env.costs.seconds(&f)
        );
    }
    eprintln!("proof {:.2}s", t.elapsed().as_secs_f64());
    println!("{:?}", found.orders[0].0);
}
