//! Bodies that several files of tests move.

/// A body of mass 1 over the rough floor z = 0, with slip in directions turned by an angle.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Where it starts.
    pub q: [f64; 3],
    /// How fast.
    pub v: [f64; 3],
    /// What acts on it besides the floor.
    pub force: [f64; 3],
    /// Of the floor.
    pub friction: f64,
    /// Of the floor.
    pub restitution: f64,
    /// By how much the directions of slip are turned.
    pub turned: f64,
}

impl Body {
    /// Its model, `m`.
    pub fn model(&self) -> String {
        let Body {
            q,
            v,
            force,
            friction,
            restitution,
            turned,
        } = self;
        let (s, c) = turned.sin_cos();
        format!(
            "model m {{
               state q[3] = {q:?};
               state v[3] = {v:?};
               q' = v;
               mechanics q, v {{
                 mass = eye(3);
                 force = {force:?};
                 contact floor {{
                   gap = q[3];
                   slip = [{c:?}*v[1] + {s:?}*v[2], {c:?}*v[2] - {s:?}*v[1]];
                   restitution = {restitution:?}; friction = {friction:?};
                 }}
               }}
             }}"
        )
    }
}
